import numpy as np
import pandas
import pytest

from midair.errors import BrokenFileError, MismatchError, RateError, ShapeError, UnitError
from midair.files import load, open_take, save
from midair.model import SensorGrid

PAIR = SensorGrid(rows=1, columns=2)


@pytest.fixture
def write(tmp_path):
    def to(text, name="a.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return to


def test_other_programs_read_midairs_own(recording, tmp_path):
    save(recording, tmp_path / "a.csv")
    table = pandas.read_csv(tmp_path / "a.csv", comment="#")
    assert list(table.columns[:3]) == ["time [s]", "row0_column0 [Pa]", "row0_column1 [Pa]"]
    np.testing.assert_allclose(table.to_numpy()[:, 1:], recording.samples.reshape(40, 15), rtol=1e-15)


def test_refuses_truncation_inside_the_last_number(recording, tmp_path):
    save(recording, tmp_path / "a.csv")
    data = (tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.csv").write_bytes(data[:-4])
    with pytest.raises(BrokenFileError, match="truncated line"):
        load(tmp_path / "a.csv")


def test_refuses_a_row_left_out(recording, tmp_path):
    save(recording, tmp_path / "a.csv")
    lines = (tmp_path / "a.csv").read_text().splitlines(keepends=True)
    (tmp_path / "a.csv").write_text("".join(lines[:-1]))
    with pytest.raises(BrokenFileError, match="expected 40 frames of 15 channels"):
        load(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("name", "stamps", "rate", "guessed"),
    [
        ("time [s]", "0 0.5 1", 2, False),
        ("time_ms", "100 600 1100", 2, False),
        ("Timestamp (us)", "0 500 1000", 2000, False),
        ("t/ns", "0 500 1000", 2e6, False),
        ("timestamp", "100 600 1100", 2, True),
        ("time", "0.0 0.01 0.02", 100, True),
    ],
)
def test_reads_the_rate_from_stamps(name, stamps, rate, guessed, write):
    rows = "".join(f"{stamp}, 1, {i}\n" for i, stamp in enumerate(stamps.split()))
    seen = open_take(write(f"{name}, a, b\n{rows}"), unit="V", sensor=PAIR)
    assert seen.recording.rate == pytest.approx(rate)
    np.testing.assert_allclose(seen.recording.samples[:, 0, 1], [0, 1, 2])
    assert any("does not state its unit" in sentence for sentence in seen.report) == guessed


def test_a_comma_at_the_end_shifts_nothing(write):
    path = write("time [s], a [V], b [V]\n0, 1, 10,\n0.1, 2, 20,\n0.2, 3, 30,\n")
    np.testing.assert_array_equal(load(path, sensor=PAIR).samples[:, 0], [[1, 10], [2, 20], [3, 30]])


def test_takes_the_common_unit_of_all_names(write):
    assert load(write("time [s],a [Pa],b [Pa]\n0,1,2\n1,2,3\n"), sensor=PAIR).unit == "Pa"
    with pytest.raises(UnitError, match="does not state the unit"):
        load(write("time [s],a [Pa],b [V]\n0,1,2\n1,2,3\n"), sensor=PAIR)


def test_assumes_the_papers_sensor_for_16_channels_and_reports_it(write):
    seen = open_take(write("\n".join(",".join(map(str, range(i, i + 16))) for i in range(3))), rate=1000, unit="count")
    assert seen.recording.sensor == SensorGrid()
    np.testing.assert_array_equal(seen.recording.samples[0], np.arange(16).reshape(4, 4))
    assert "4 x 4, row by row, 11 mm apart was assumed" in seen.report[0]


def test_keeps_the_source(write):
    path = write("time [s],a [V],b [V]\n0,1,2\n1,2,3\n", name="mine.csv")
    life = load(path, sensor=PAIR).provenance
    assert life.source == "mine.csv"
    assert not life.simulated
    assert life.steps[0].stage == "import"
    assert len(life.steps[0].settings["sha256"]) == 64


@pytest.mark.parametrize(
    ("text", "said", "error", "message"),
    [
        ("1,2\n3,4\n", {"unit": "V", "sensor": PAIR}, RateError, "does not state its frame rate"),
        ("1,2\n3,4\n", {"rate": 10, "sensor": PAIR}, UnitError, "does not state the unit"),
        ("1,2\n3,4\n", {"rate": 10, "unit": "V"}, ShapeError, "2 channels and does not state their layout"),
        ("1,2\n3,4\n", {"rate": 10, "unit": "V", "sensor": SensorGrid()}, MismatchError, "got a sensor of 4 x 4"),
        ("t,a\n0,1\n1,2\n", {"rate": 10, "unit": "V"}, RateError, "expected about 1 Hz"),
        ("a [V]\n1\n2\n", {"rate": 10, "unit": "Pa"}, MismatchError, "the file states V"),
        ("a\xff\x00", {}, BrokenFileError, "got none"),
    ],
)
def test_names_missing_or_contradicting_facts(text, said, error, message, write):
    with pytest.raises(error, match=message):
        load(write(text), **said)


def test_refuses_bytes_that_are_not_text(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"a,b\n1,\xff\n")
    with pytest.raises(BrokenFileError, match="damaged or foreign"):
        load(tmp_path / "a.csv")
