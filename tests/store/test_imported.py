import numpy as np
import pytest

from midair.errors import MismatchError, RateError, ShapeError, UnitError
from midair.model import SensorGrid
from midair.store.imported import Foreign, Given


@pytest.fixture
def path(tmp_path):
    (tmp_path / "a.bin").write_bytes(b"bytes")
    return tmp_path / "a.bin"


def foreign(shape, **says):
    return Foreign(samples=np.zeros(shape), form="bin", **says)


def test_what_the_file_says_needs_nothing_given(path):
    sensor = SensorGrid(rows=1, columns=3)
    seen = foreign((5, 3), rate=10.0, unit="V", sensor=sensor).settle(Given(), path)
    assert (seen.recording.rate, seen.recording.unit, seen.recording.sensor) == (10, "V", sensor)
    assert seen.report == ()


def test_what_the_file_does_not_say_is_taken_as_given(path):
    given = Given(rate=10.0, unit="Pa", sensor=SensorGrid(rows=3, columns=1))
    recording = foreign((5, 3)).settle(given, path).recording
    assert (recording.rate, recording.unit, recording.sensor) == (10, "Pa", given.sensor)


def test_the_report_goes_into_the_provenance(path):
    seen = foreign((5, 16), report=("First.",)).settle(Given(rate=10.0, unit="V"), path)
    assert seen.report[0] == "First."
    assert len(seen.report) == 2
    assert seen.recording.provenance.steps[0].settings["report"] == seen.report


@pytest.mark.parametrize(
    ("shape", "given", "error"),
    [
        ((5, 16), Given(unit="V"), RateError),
        ((5, 16), Given(rate=10.0), UnitError),
        ((5, 15), Given(rate=10.0, unit="V"), ShapeError),
        ((5, 2, 8), Given(rate=10.0, unit="V", sensor=SensorGrid()), MismatchError),
        ((5, 16), Given(rate=10.0, unit="V", sensor=SensorGrid(rows=4, columns=5)), MismatchError),
    ],
)
def test_refuses_what_nobody_says_or_what_does_not_fit(shape, given, error, path):
    with pytest.raises(error, match=r"a\.bin"):
        foreign(shape).settle(given, path)
