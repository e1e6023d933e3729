import numpy as np
import pytest

from midair.errors import InputError, MismatchError, ShapeError, UnitError
from midair.files.opened_take import ImportedData, ImportOptions
from midair.model import SensorGrid


@pytest.fixture
def path(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"bytes")
    return tmp_path / "a.bin"


def foreign(shape, **says):
    return ImportedData(samples=np.zeros(shape), form="bin", **says)


def test_the_report_goes_into_the_provenance(path):
    seen = foreign((5, 16), report=("First.",)).resolve(ImportOptions(rate=10.0, unit="V"), path)
    assert seen.report[0] == "First."
    assert len(seen.report) == 2
    assert seen.recording.provenance.steps[0].settings["report"] == seen.report


def test_channels_are_chosen_by_name_or_number_in_any_order(path):
    samples = np.arange(12.0).reshape(3, 4)
    file = ImportedData(samples=samples, form="bin", rate=10.0, names=("a", "b", "c", "d"), units=("V", "Pa", "V", ""))
    pair = SensorGrid(rows=1, columns=2)
    seen = file.resolve(ImportOptions(channels=("c", "0"), sensor=pair), path)
    np.testing.assert_array_equal(seen.recording.samples[:, 0], samples[:, [2, 0]])
    assert seen.recording.unit == "V"
    assert seen.recording.provenance.steps[0].settings["channels"] == ("c", "a")
    with pytest.raises(UnitError):
        file.resolve(ImportOptions(channels=("a", "b"), sensor=pair), path)
    for missing in (("e",), ("4",), ("-1",), (), ("a", "0")):
        with pytest.raises(ShapeError, match=r"expected (a channel by name|different channels)"):
            file.resolve(ImportOptions(channels=missing), path)


def test_a_chosen_channel_reports_repeated_rows(path):
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(50, 2))
    samples[[7, 20, 21], 0] = samples[[6, 19, 19], 0]
    file = ImportedData(samples=samples, form="bin", rate=10.0, units=("V", "V"))
    seen = file.resolve(ImportOptions(channels=("0",)), path)
    assert seen.report == ("3 of 50 rows repeat every channel of the row before, at a later time: they were kept.",)


def test_a_scale_makes_pressure_of_any_number(path):
    file = ImportedData(samples=np.full((3, 1), 2.0), form="bin", rate=10.0)
    recording = file.resolve(ImportOptions(scale=1.5), path).recording
    assert (recording.unit, recording.samples[0, 0, 0]) == ("Pa", 3.0)
    with pytest.raises(MismatchError, match="the file states Pa"):
        foreign((3, 1), rate=10.0, units=1 * ("Pa",)).resolve(ImportOptions(scale=2.0), path)
    with pytest.raises(MismatchError, match="leave the unit out"):
        ImportOptions(scale=2.0, unit="V")
    for scale in (0.0, np.nan):
        with pytest.raises(InputError, match="other than 0 Pa"):
            ImportOptions(scale=scale)
