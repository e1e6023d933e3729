"""XDF: streams written here by the specification, read by pyxdf."""

import sys

import numpy as np
import pytest
from tests.foreign_files import xdf, xdf_whole

from midair.errors import BrokenFileError, MismatchError, MissingExtraError
from midair.files import load, open_take

LABELS = tuple(f"mic{i}" for i in range(16))


@pytest.fixture
def samples():
    return np.random.default_rng(1).normal(size=(200, 16)).astype("f4").astype(float)


@pytest.fixture
def file(tmp_path):
    def write(data):
        (tmp_path / "a.xdf").write_bytes(data)
        return tmp_path / "a.xdf"

    return write


def test_reads_a_stream_with_its_names_and_unit(samples, file):
    seen = open_take(file(xdf_whole(xdf(samples, labels=LABELS, unit="volts"))))
    recording = seen.recording
    np.testing.assert_array_equal(recording.samples.reshape(200, 16), samples)
    assert recording.rate == pytest.approx(1000, rel=1e-9)
    assert recording.unit == "V"
    assert recording.provenance.notes["stream"] == "skin"
    assert recording.provenance.notes["device"] == "bench"
    assert "4 x 4, row by row" in " ".join(seen.report)


@pytest.mark.long
def test_several_streams_need_a_name(samples, file):
    data = xdf_whole(xdf(samples, name="skin"), xdf(samples[:, :3] * 2, name="arm", number=2))
    with pytest.raises(BrokenFileError, match=r"expected one stream of numbers.*skin \(200\), arm \(200\)"):
        load(file(data), unit="V")
    assert load(file(data), unit="V", field="arm", channels=["1"]).samples[5, 0, 0] == 2 * samples[5, 1]
    with pytest.raises(MismatchError, match="called 'leg'"):
        load(file(data), unit="V", field="leg")


def test_damage_is_reported_not_printed(samples, file, capsys):
    data = bytearray(xdf_whole(xdf(samples), xdf(samples, name="arm", number=2)))
    place = data.rindex(b"\x04" + np.uint32(200).tobytes())
    data[place] = 9
    seen = open_take(file(bytes(data)), unit="V", field="skin")
    assert any("pyxdf: found likely XDF file corruption" in sentence for sentence in seen.report)
    assert capsys.readouterr() == ("", "")


def test_names_the_package_to_install(samples, file, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyxdf", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'midair\[xdf\]'"):
        load(file(xdf_whole(xdf(samples))), unit="V")
