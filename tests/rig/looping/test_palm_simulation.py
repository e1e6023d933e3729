import numpy as np
import pytest

from midair.model import Acoustics, Drive, Palm, PressureFrames, SensorGrid
from midair.physics import PlaybackChain, focus_phase
from midair.rig.looping.palm_simulation import palm_of_drive
from midair.rig.names.virtual_rig import VirtualRig

RIG = VirtualRig()
PALM = Palm.disc(85e-3, pitch=5e-3)


def beating(place):
    """A focus at a place of the palm that swells at 100 Hz, for .1 s, and the same at the middle as the cells' wish."""
    phase = focus_phase(RIG.array, np.array([*place, 0.2]))
    swell = 0.5 + 0.25 * np.sin(2 * np.pi * 100 * np.arange(100) / 1000)
    drive = Drive(
        phase=np.tile(phase, (100, 1)),
        level=np.tile(np.sqrt(swell)[:, None], (1, RIG.array.count)),
        rate=1000.0,
        array=RIG.array,
        acoustics=Acoustics(),
    )
    asked = np.zeros((100, 4, 4))
    asked[:, 1:3, 1:3] = (swell - 0.5)[:, None, None]
    return PressureFrames(pressure=asked, rate=1000.0, sensor=SensorGrid()), drive


@pytest.mark.parametrize("beside", [False, True])
def test_a_focus_beside_the_square_presses_outside_and_moves_the_skin_otherwise(beside):
    asked, drive = beating((0.036, 0.0) if beside else (0.0, 0.0))
    found = palm_of_drive(asked, drive, PALM, chain=PlaybackChain(), rig=RIG, judged=(0.02, 0.06))
    # A focus is narrower than what cells make of one.
    assert found.outside > 0.9 if beside else found.outside < 0.01
    assert found.range[1] < -10 if beside else found.range[0] > -5
