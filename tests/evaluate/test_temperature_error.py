"""Error E of a drive in other air: by hand for a single focus, and the selection of frames."""

from dataclasses import replace

import numpy as np
import pytest

from midair.errors import MismatchError
from midair.evaluate import error_at_temperature
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, Medium, TransducerArray
from midair.physics import focus_phase, propagate

ARRAY = TransducerArray.autd3(columns=1, rows=1)
POINT = ControlGrid(rows=1, columns=1, height=0.15)
ROOM = Acoustics(medium=Medium.at(temperature=26.0))


def focused(frames, air=None):
    phase = np.broadcast_to(focus_phase(ARRAY, POINT.position[0], acoustics=air), (frames, ARRAY.count))
    level = np.tile([0.2, 0.5, 0.0], frames)[:frames]
    drive = Drive(phase=phase, level=level, rate=1000.0, array=ARRAY, acoustics=air or Acoustics())
    return drive, AmplitudeFrames(amplitude=np.abs(propagate(drive, POINT)), rate=1000.0, grid=POINT)


def test_the_error_in_its_own_and_in_denser_air():
    np.testing.assert_allclose(error_at_temperature(*focused(6, ROOM), ROOM.medium), np.zeros(4), atol=1e-12)
    # Only rho changes, no phase and no loss: P = alpha p^2 / (2 rho c^2), so p must be larger by sqrt(2).
    drive, target = focused(3)
    dense = replace(Medium(), density=2.5)
    np.testing.assert_allclose(error_at_temperature(drive, target, dense), np.full(2, 1 - 1 / np.sqrt(2)), rtol=1e-9)


def test_selected_frames_represent_all_audible_ones_of_the_target_of_this_drive():
    drive, target = focused(300)
    warm = Medium.at(temperature=30.0)
    everything, some = error_at_temperature(drive, target, warm), error_at_temperature(drive, target, warm, frames=7)
    assert (len(everything), len(some)) == (200, 7)
    np.testing.assert_allclose(some, everything[0], rtol=1e-6)
    drive, target = focused(2)
    silent = replace(target, amplitude=np.zeros((2, 1)))
    assert error_at_temperature(drive, silent, Medium()).shape == (0,)
    with pytest.raises(MismatchError, match="expected 3 frames as in the drive, got 2"):
        error_at_temperature(focused(3)[0], focused(2)[1], Medium())
