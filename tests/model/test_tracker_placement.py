"""Rotation and offset from a tracker to the array."""

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import PalmPath, TrackerPlacement

QUARTER = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


def test_a_quarter_turn_moves_and_turns_a_pose():
    palm = PalmPath(time=[0.0], centre=[[0.1, 0, 0.2]], normal=[[0, 0, -1]], fingers=[[0, 1, 0]], confidence=[0.5])
    placed = TrackerPlacement(rotation=QUARTER, offset=[0, 0, 0.01]).path(palm)
    np.testing.assert_allclose(placed.centre, [[0, 0.1, 0.21]])
    np.testing.assert_allclose(placed.fingers, [[-1, 0, 0]])


@pytest.mark.parametrize("wrong", [np.diag([1, 1, -1]), 2 * np.eye(3)])
def test_a_mirror_or_a_scale_is_refused(wrong):
    with pytest.raises(InputError, match="without a mirror"):
        TrackerPlacement(rotation=wrong)
