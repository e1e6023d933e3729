import numpy as np
import pytest

from midair.errors import InputError, NonFiniteError, ShapeError, UnitError
from midair.model import Recording, SensorGrid


def test_times_are_exact_multiples_of_the_period():
    recording = Recording(samples=np.zeros((1001, 4, 4)), rate=1000.0)
    assert recording.frames == 1001
    assert recording.duration == 1.001
    assert recording.time[1000] == 1.0
    assert recording.unit == "V"


def test_the_samples_are_a_copy():
    samples = np.zeros((3, 4, 4))
    recording = Recording(samples=samples, rate=1000.0)
    samples[:] = 1
    assert not recording.samples.any()
    with pytest.raises(ValueError, match="read-only"):
        recording.samples[0, 0, 0] = 1


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"samples": np.zeros((3, 16))}, ShapeError, r"\(frame, 4, 4\), got shape \(3, 16\)"),
        ({"samples": np.zeros((0, 4, 4))}, ShapeError, "samples"),
        ({"sensor": SensorGrid(rows=2)}, ShapeError, r"\(frame, 2, 4\)"),
        ({"samples": np.full((3, 4, 4), np.nan)}, NonFiniteError, "nan"),
        ({"rate": 0}, InputError, "rate: expected a number above 0 Hz"),
        ({"unit": "mV"}, UnitError, "V, count, Pa, got 'mV'"),
    ],
)
def test_bad_input_is_refused(changes, error, says):
    with pytest.raises(error, match=says):
        Recording(**({"samples": np.zeros((3, 4, 4)), "rate": 1000.0} | changes))
