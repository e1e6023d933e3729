import numpy as np
import pandas
import pytest
from scipy.interpolate import CubicSpline
from tests.palms import palm_path

from midair.datasets.strokes import sample_path
from midair.errors import BrokenFileError, MismatchError, NonFiniteError, RateError, UnitError
from midair.files import load, load_palm_path, open_take, save, save_palm_path
from midair.files.importers.csv_file import read_table
from midair.model import SensorGrid
from midair.recordings import Mending

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


def test_takes_the_common_unit_of_all_names(write):
    assert load(write("time [s],a [Pa],b [Pa]\n0,1,2\n1,2,3\n"), sensor=PAIR).unit == "Pa"
    mixed = load(write("time [s],a [mV],b (V)\n0,1,2\n1,2,3\n"), sensor=PAIR)
    np.testing.assert_array_equal(mixed.samples[0], [[1e-3, 2]])
    for other in ("b [V]", "b", "b [N]"):
        with pytest.raises(UnitError, match="expected one unit in all channels, got"):
            load(write(f"time [s],a [Pa],{other}\n0,1,2\n1,2,3\n"), sensor=PAIR, unit="Pa")
    with pytest.raises(UnitError, match="one unit in all channels, got V, mV"):
        load(write("time [s],a [mV],b (V)\n0,1,2\n1,2,3\n"), sensor=PAIR, scale=2)


def test_a_unit_without_brackets_is_read_too(write):
    """Who obeyed the message and stated V got a thousand times the voltage."""
    for name in ("U/mV", "CH1 mV", "ch1_mV", "mV", "a {mV}", "a <mV>"):
        assert load(write(f"time_s;{name}\n0;1\n1;2\n")).samples[1, 0, 0] == pytest.approx(2e-3)
        with pytest.raises(MismatchError):
            load(write(f"time_s;{name.replace('mV', 'kPa')}\n0;1\n1;2\n"), unit="V")


def test_a_unit_that_is_not_known_is_no_other(write):
    path = write("time [s],a [N]\n0,1\n1,2\n")
    with pytest.raises(UnitError, match="expected V, Pa or count, the file states N; give scale"):
        load(path)
    with pytest.raises(MismatchError, match="states N, got V; give a scale"):
        load(path, unit="V")
    assert load(path, scale=2).samples[1, 0, 0] == 4
    assert load(path, unit="count").unit == "count"
    assert load(write("time [s],a (x)\n0,1\n1,2\n"), unit="V").unit == "V"


def test_keeps_the_source(write):
    path = write("time [s],a [V],b [V]\n0,1,2\n1,2,3\n", name="mine.csv")
    life = load(path, sensor=PAIR).provenance
    assert life.source == "mine.csv"
    assert not life.simulated
    assert life.steps[0].stage == "import"
    assert len(life.steps[0].settings["sha256"]) == 64


def test_names_contradicting_facts(write, subtests):
    for text, said, error, message in [
        ("1,2\n3,4\n", {"rate": 10, "unit": "V", "sensor": SensorGrid()}, MismatchError, "got a sensor of 4 x 4"),
        ("t [s],a\n0,1\n1,2\n", {"rate": 10, "unit": "V"}, RateError, "expected about 1 Hz"),
        ("a [V]\n1\n2\n", {"rate": 10, "unit": "Pa"}, MismatchError, "the file states V"),
    ]:
        with subtests.test(message=message), pytest.raises(error, match=message):
            load(write(text), **said)


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
    # Between the first and the last stamp, interpolation keeps close to the neighbours: a frame picked by hand.
    np.testing.assert_array_equal(recording.samples[0].ravel(), table[0, 3:])
    np.testing.assert_allclose(recording.samples[-1].ravel(), table[-1, 3:], atol=1e-6)
    place = 200 / recording.rate * 1e3 + table[0, 0]
    later = int(np.argmax(table[:, 0] > place))
    near = slice(later - 10, later + 10)
    expected = CubicSpline(table[near, 0], table[near, 3:])(place)
    np.testing.assert_allclose(recording.samples[200].ravel(), expected, atol=1e-3)


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


def test_repeated_rows_and_gaps_are_reported(tmp_path):
    lines = sample_path("denim").read_text().splitlines()
    (tmp_path / "a.csv").write_text("\n".join([*lines[:50], lines[49], *lines[50:100], *lines[101:]]))
    seen = open_take(tmp_path / "a.csv")
    text = " ".join(seen.report)
    for part in ("1 of 424 rows repeat stamp and numbers", "99.8 % of 424 rows used", "1 gaps in the time stamps"):
        assert part in text
    assert {(event.kind, event.frames) for event in seen.journal} == {("mended", 1)}
    assert seen.recording.frames == pytest.approx(424, abs=1)
    (tmp_path / "a.csv").write_text("\n".join([*lines[:100], *lines[110:]]))
    with pytest.raises(NonFiniteError, match="expected gaps of 20 ms at most"):
        open_take(tmp_path / "a.csv")
    assert open_take(tmp_path / "a.csv", mending=Mending(longest=0.5)).recording.frames == 424


HEAD = "time,x,y,z,nx,ny,nz,dx,dy,dz,confidence\n"


def test_poses_are_read_as_they_were_written(tmp_path):
    rng = np.random.default_rng(1)
    palm = palm_path(np.arange(5) / 110, rng.random((5, 3)), confidence=rng.random(5))
    save_palm_path(palm, tmp_path / "hand.csv")
    read = load_palm_path(tmp_path / "hand.csv")
    for name in ("time", "centre", "normal", "fingers", "confidence"):
        np.testing.assert_array_equal(getattr(read, name), getattr(palm, name))


def test_a_file_of_other_content_is_refused(tmp_path, subtests):
    for text, told in [
        ("time,x\n0,1\n", "expected the columns time,x,y,z"),
        (HEAD + "0,0,0,.2,0,0,-2,0,1,0,1\n", "vectors of length 1"),
        (HEAD + "0,0,0,.2,0,0,-1,0,1,0,1\n" * 2, "increasing times"),
        (HEAD + "0,0,0,.2,0,0,-1,0,1,0,7\n", "confidence"),
        (HEAD + "0,0,0,200,0,0,-1,0,1,0,1\n", "centre of the palm.* got 200 m; lengths are in metres, 200 mm is 0.2"),
    ]:
        (tmp_path / "hand.csv").write_text(text)
        with subtests.test(text=text), pytest.raises(BrokenFileError, match=told):
            load_palm_path(tmp_path / "hand.csv")


def test_reads_every_dialect_alike(subtests):
    for text in (
        "a, b, c\n1, 2, 3\n4, 5, 6",
        "a,b,c\r\n1,2,3\r\n4,5,6\r\n",
        "a,b,c\n1,2,3,\n4,5,6,\n",
        "a,b,c,\n1,2,3,\n4,5,6,\n",
        "# made by a machine, 2019\na,b,c\n\n1,2,3\n  \n4,5,6\n\n",
        '"a","b","c"\n"1","2","3"\n4,5,6\n',
        " a ,b , c \n 1 ,2.0,3e0\n4,+5,6\n",
    ):
        with subtests.test(text=text):
            table = read_table(text)
            assert table.names == ("a", "b", "c")
            np.testing.assert_array_equal(table.samples, [[1, 2, 3], [4, 5, 6]])


def test_errors_name_the_place(subtests):
    for text, error, message in [
        ("", BrokenFileError, "expected rows of numbers, got none"),
        ("a,b\n", BrokenFileError, "expected rows of numbers, got none"),
        ("a,b\n1,2\n3\n", BrokenFileError, "expected 2 columns in line 3, got 1"),
        ("a,b\n1,2,3\n", BrokenFileError, "expected 2 columns in line 2, got 3"),
        ("1;2;3\n4;5;6\n7;8;9;9\n1;2;3\n", BrokenFileError, "expected 3 columns in line 3, got 4"),
        ("a,b\n1,x\n", BrokenFileError, "got 'x' in line 2, column 'b'"),
        ("a,b\n1,1_000\n", BrokenFileError, "got '1_000' in line 2, column 'b'"),
        ("a,b\n1,\n1,2\n", NonFiniteError, "empty field in line 2, column 'b'"),
        ("a,b\n,1\n2,1\n", NonFiniteError, "empty field in line 2, column 'a'"),
        ("a,b\n1,2\n3,nan\n", NonFiniteError, "got nan in line 3, column 'b'"),
        ("1,2\n3,inf\n", NonFiniteError, "got inf in line 2, column 2"),
    ]:
        with subtests.test(text=text), pytest.raises(error, match=message):
            read_table(text)
