import numpy as np
import pytest

from midair.datasets.catalogue import sample_path
from midair.errors import BrokenFileError, MismatchError, NonFiniteError, RateError
from midair.files import open_take
from midair.model import SensorGrid


@pytest.fixture
def table():
    return np.loadtxt(sample_path("denim"), delimiter=",", skiprows=1)


def test_recognises_its_files(table):
    seen = open_take(sample_path("denim"))
    recording = seen.recording
    assert recording.unit == "count"
    assert recording.sensor == SensorGrid(rows=4, columns=4, pitch=11e-3, name="CPM-finger of FabricSlide")
    assert recording.rate == pytest.approx(1e3 * 423 / (2144987 - 2133112))
    assert recording.frames == 424
    # Between the first and the last stamp, linear interpolation keeps within the neighbours: hand-picked frames.
    np.testing.assert_array_equal(recording.samples[0].ravel(), table[0, 3:])
    np.testing.assert_allclose(recording.samples[-1].ravel(), table[-1, 3:], atol=1e-6)
    place = 200 / recording.rate * 1e3 + table[0, 0]
    later = int(np.argmax(table[:, 0] > place))
    part = (place - table[later - 1, 0]) / (table[later, 0] - table[later - 1, 0])
    expected = (1 - part) * table[later - 1, 3:] + part * table[later, 3:]
    np.testing.assert_allclose(recording.samples[200].ravel(), expected, atol=1e-6)


def test_reports_changes_and_assumptions():
    seen = open_take(sample_path("denim"))
    text = " ".join(seen.report)
    for part in ("27 to 29 ms apart", "35.6210526 Hz", "proximity1 and proximity2 were left out", "Neither the layout"):
        assert part in text
    notes = seen.recording.provenance.notes
    assert notes["material"] == "Denim"
    assert notes["speed"] == "-50 mm/s"
    assert "unit not stated" in notes["force"]
    assert "pitch" in notes["layout"]
    assert seen.recording.provenance.steps[0].settings["left_out"] == ("proximity1", "proximity2")


def test_takes_a_layout_that_is_given():
    sensor = SensorGrid(rows=2, columns=8, pitch=3e-3, name="finger")
    seen = open_take(sample_path("denim"), sensor=sensor, rate=35.6)
    assert seen.recording.sensor == sensor
    assert seen.recording.rate == 35.6
    assert "layout" not in seen.recording.provenance.notes


def test_refuses_what_contradicts_the_file():
    with pytest.raises(MismatchError, match="the file states count"):
        open_take(sample_path("denim"), unit="V")
    with pytest.raises(RateError, match="expected about"):
        open_take(sample_path("denim"), rate=1000)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (lambda lines: [*lines[:50], lines[50].rsplit(",", 3)[0]], BrokenFileError),
        (lambda lines: [*lines[:50], lines[50].replace(",", ",,", 1), *lines[51:]], BrokenFileError),
        (lambda lines: [*lines[:50], ",".join([*lines[50].split(",")[:-1], ""]), *lines[51:]], NonFiniteError),
        (lambda lines: [lines[0], *reversed(lines[1:])], RateError),
    ],
    ids=["cut", "a field too many", "a missing value", "backwards"],
)
def test_refuses_a_damaged_copy(change, error, tmp_path):
    lines = sample_path("denim").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join(change(lines)))
    with pytest.raises(error):
        open_take(tmp_path / "a.csv")


def test_rows_that_end_in_a_comma_change_nothing(tmp_path):
    lines = sample_path("denim").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join([lines[0], *(line + "," for line in lines[1:])]))
    np.testing.assert_array_equal(
        open_take(tmp_path / "a.csv").recording.samples, open_take(sample_path("denim")).recording.samples
    )


def test_repeated_rows_and_gaps_are_reported(tmp_path):
    lines = sample_path("denim").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join([*lines[:50], lines[49], *lines[50:100], *lines[110:]]))
    seen = open_take(tmp_path / "a.csv")
    assert any("1 of 415 rows have the time stamp of the row before" in sentence for sentence in seen.report)
    assert any("1 gaps in the time stamps" in sentence for sentence in seen.report)
    assert seen.recording.frames == pytest.approx(424, abs=1)
