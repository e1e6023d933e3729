import numpy as np
import pytest

from midair.errors import InputError
from midair.model import ControlGrid, PressureFrames
from midair.targets import Circle, prepare

FINE = ControlGrid(rows=61, columns=61, pitch=1e-3)


def steady(frames=400, rate=1000.0):
    pressure = np.zeros((frames, 4, 4))
    pressure[:, 1, 1] = 10.0
    return PressureFrames(pressure=pressure, rate=rate)


def centroid(amplitude):
    maps = amplitude.reshape(-1, 61, 61)
    total = maps.sum(axis=(1, 2))
    return np.stack([maps.sum(axis=1) @ FINE.x, maps.sum(axis=2) @ FINE.y], axis=1) / total[:, None]


def test_the_pattern_turns_once_in_a_fifth_of_a_second():
    still = centroid(prepare(steady(), grid=FINE).amplitude)
    moved = centroid(prepare(steady(), grid=FINE, circle=Circle(radius=3e-3, frequency=5.0)).amplitude) - still
    np.testing.assert_allclose(np.hypot(*moved.T), 3e-3, atol=5e-5)
    np.testing.assert_allclose(moved[0], [3e-3, 0], atol=5e-5)
    np.testing.assert_allclose(moved[50], [0, 3e-3], atol=5e-5)
    np.testing.assert_allclose(moved[200:], moved[:200], atol=1e-9)


def test_the_text_describes_the_circle_and_that_it_is_not_validated():
    step = prepare(steady(2), circle=Circle()).provenance.steps[-1]
    assert step.settings["motion"] == "circle of 3 mm at 5 Hz, not validated on people"
    assert (step.settings["circle_m"], step.settings["circle_hz"]) == (3e-3, 5.0)
    assert "motion" not in prepare(steady(2)).provenance.steps[-1].settings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"radius": 0.0}, "radius of the circle"),
        ({"frequency": -5.0}, "frequency of the circle: expected a number above 0 Hz"),
        ({"frequency": 20.0}, "below 20 Hz, got 20 Hz"),
    ],
)
def test_circles_that_are_none_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        Circle(**settings)
