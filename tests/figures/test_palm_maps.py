import numpy as np
import pytest

from midair.evaluate import PressedPalm
from midair.figures.maps import PalmPanel, palm_figure, strongest_moment
from midair.model import PressureFrames

PALM = PressedPalm(
    wanted=np.ones((7, 7)), delivered=np.where(np.eye(7) > 0, np.nan, 3.0), pitch=5e-3, square=(10e-3, 10e-3)
)


def pressed(rate):
    """A second in which channel 6 is struck at half a second."""
    time = np.arange(int(rate)) / rate
    pressure = np.zeros((len(time), 4, 4))
    pressure[:, 1, 2] = np.where(abs(time - 0.5) < 0.03, 5.0, 0.0)
    return PressureFrames(pressure=pressure, rate=rate, band=(20.0, 400.0))


def test_the_window_lies_around_the_strongest_moment():
    cell, begin = strongest_moment(pressed(1000.0), 0.1)
    assert cell == (1, 2)
    assert begin <= 0.471
    assert begin + 0.1 >= 0.529


def test_every_way_has_a_map_and_a_trace_at_its_own_rate():
    ways = [
        PalmPanel(name="fast", felt=pressed(4000.0), pressed=PALM),
        PalmPanel(name="slow", felt=pressed(1000.0), pressed=PALM),
    ]
    above, below = palm_figure(pressed(4000.0), ways).subfigs
    assert [axis.get_title("left") for axis in above.axes[:3]] == ["target", "fast", "slow"]
    assert len({axis.images[0].get_clim() for axis in above.axes[:3]}) == 1
    for axis, (_, slower) in zip(below.axes, [(1, 1), (1, 4)], strict=True):
        original, felt = (line.get_xydata() for line in axis.lines)
        assert len(felt) == pytest.approx(len(original) / slower, abs=1)
        # Struck at the same time in both.
        struck = [line[line[:, 1] > 1, 0].mean() for line in (original, felt)]
        assert struck[0] == pytest.approx(struck[1], abs=2e-3)
