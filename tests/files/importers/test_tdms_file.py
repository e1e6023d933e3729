"""TDMS: segments written here after National Instruments' description."""

import numpy as np
import pytest

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files import load, open_take
from midair.model import SensorGrid

PAIR = SensorGrid(rows=1, columns=2)


@pytest.fixture
def file(tmp_path):
    def write(data):
        (tmp_path / "a.tdms").write_bytes(data)
        return tmp_path / "a.tdms"

    return write


@pytest.fixture
def columns():
    rng = np.random.default_rng(2)
    return {"a": rng.normal(size=60), "it's b": rng.normal(size=60).astype("f4")}


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("chunks", [1, 3])
def test_reads_every_layout(order, interleaved, chunks, tdms, columns, file):
    seen = open_take(file(tdms(columns, order=order, interleaved=interleaved, chunks=chunks)), sensor=PAIR)
    for i, name in enumerate(columns):
        np.testing.assert_array_equal(seen.recording.samples[:, 0, i], columns[name])
    assert seen.recording.rate == 1000
    assert seen.recording.unit == "V"
    assert seen.recording.provenance.notes["group"] == "skin"
    assert seen.report == ()


def test_later_segments_without_metadata_go_on(tdms, columns, file):
    more = {name: column + 1 for name, column in columns.items()}
    recording = load(file(tdms(columns) + tdms(more, meta=False)), sensor=PAIR)
    assert recording.frames == 120
    np.testing.assert_array_equal(recording.samples[60:, 0, 0], columns["a"] + 1)


@pytest.mark.parametrize("dtype", ["i2", "i4", "u1", "f4"])
def test_whole_numbers_stay_whole(dtype, tdms, file):
    data = np.array([1, 2, 250 if dtype == "u1" else -3], dtype)
    assert load(file(tdms({"x": data}, said={})), rate=50, unit="count").samples.ravel().tolist() == data.tolist()


def test_requires_a_missing_rate(tdms, columns, file):
    path = file(tdms(columns, said={"unit_string": "mV"}))
    assert load(path, rate=48000, sensor=PAIR).samples[0, 0, 0] == columns["a"][0] * 1e-3
    assert load(path, rate=48000, sensor=PAIR).rate == 48000


def test_several_groups_need_a_name(tdms, columns, file):
    path = file(tdms(columns) + tdms(columns, group="arm"))
    with pytest.raises(BrokenFileError, match=r"skin \(2 channels\), arm \(2 channels\)"):
        load(path, sensor=PAIR)
    assert load(path, sensor=PAIR, field="arm").frames == 60
    with pytest.raises(MismatchError, match="expected a group 'leg'"):
        load(path, field="leg")


def test_an_unclosed_file_gives_its_complete_records(tdms, columns, file):
    data = tdms(columns, chunks=6)
    unfinished = data[:12] + b"\xff" * 8 + data[20:-5]
    seen = open_take(file(unfinished), sensor=PAIR)
    assert seen.recording.frames == 50
    assert seen.report == ("The file was not closed: complete records were read.",)


def test_refuses_data_that_it_would_misread(tdms, columns, file):
    with pytest.raises(UnknownFormatError, match="scaled by NI_Scale"):
        load(file(tdms(columns, said={"NI_Scale[0]_Linear_Slope": 2.0})), sensor=PAIR)
    daqmx = bytearray(tdms(columns))
    daqmx[4] |= 128
    with pytest.raises(UnknownFormatError, match="DAQmx raw data"):
        load(file(bytes(daqmx)), sensor=PAIR)
    with pytest.raises(BrokenFileError, match="channels of one length in group 'skin', got a 60, b 50"):
        load(file(tdms({"a": columns["a"]}) + tdms({"b": columns["a"][:50]})), sensor=PAIR)
