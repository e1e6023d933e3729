import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.model import Calibration, SensorGrid

SENSOR = SensorGrid(rows=2, columns=3)


def made(**changes):
    rng = np.random.default_rng(0)
    parts = {
        "sensor": SENSOR,
        "frequency": np.array([0.0, 10.0, 30.0]),
        "response": rng.standard_normal((3, 2, 3, 2)) @ np.array([1, 1j]),
        "noise": np.zeros((2, 3)),
    }
    return Calibration(**(parts | changes))


@given(st.floats(0, 1e5), st.floats(1e-6, 1e6))
def test_a_flat_one_is_the_same_everywhere(frequency, sensitivity):
    flat = Calibration.flat(SENSOR, sensitivity=sensitivity, unit="count")
    assert flat.response_at(np.array([frequency]))[0] == pytest.approx(np.full((2, 3), sensitivity))
    assert flat.unit == "count"
    assert "nominal" in flat.provenance.source


def test_bins_come_back_and_the_middle_is_the_mean():
    calibration = made()
    assert calibration.response_at(calibration.frequency) == pytest.approx(calibration.response)
    between = calibration.response_at(np.array([5.0, 15.0]))
    assert between[0] == pytest.approx((calibration.response[0] + calibration.response[1]) / 2)
    assert between[1] == pytest.approx(0.75 * calibration.response[1] + 0.25 * calibration.response[2])


def test_the_ends_are_held():
    calibration = made(frequency=np.array([5.0, 10.0, 30.0]))
    ends = calibration.response_at(np.array([0.0, 1e4]))
    assert ends == pytest.approx(calibration.response[[0, -1]])


def test_one_bin_is_held_everywhere():
    one = made(frequency=np.array([10.0]), response=np.full((1, 2, 3), 2 + 1j))
    assert one.response_at(np.array([0.0, 10.0, 99.0])) == pytest.approx(np.full((3, 2, 3), 2 + 1j))


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"frequency": np.array([0.0, 30.0, 10.0])}, InputError, "increasing"),
        ({"frequency": np.array([-1.0, 10.0, 30.0])}, InputError, "from 0 Hz"),
        ({"response": np.zeros((2, 2, 3))}, ShapeError, "response"),
        ({"response": np.full((3, 2, 3), np.nan)}, NonFiniteError, "response"),
        ({"noise": np.full((2, 3), -1.0)}, InputError, "noise: .*-1"),
        ({"noise": np.zeros((3, 2))}, ShapeError, "noise"),
    ],
)
def test_bad_input_is_refused(changes, error, says):
    with pytest.raises(error, match=says):
        made(**changes)


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_a_sensitivity_must_be_one(bad):
    with pytest.raises(InputError, match="sensitivity"):
        Calibration.flat(SENSOR, sensitivity=bad)


def test_an_identifier_never_changes_for_the_same_calibration():
    calibration = Calibration.flat(SensorGrid(name="skin"), sensitivity=0.02)
    assert calibration.identifier == "fdff85f2"
