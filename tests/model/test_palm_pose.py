from typing import Any

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import PalmPath, TrackerPlacement

FLAT: dict[str, Any] = {"centre": [[0, 0, 0.2]], "normal": [[0, 0, -1]], "fingers": [[0, 1, 0]], "confidence": [1.0]}


def test_a_palm_that_faces_the_array_has_the_axes_of_the_array():
    path = PalmPath(time=[0.0], **FLAT)
    np.testing.assert_array_equal(path.rotation[0], np.eye(3))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"time": [0.0, 1.0]}, "one of each value for each time"),
        ({"normal": [[0, 0, -2]]}, "vectors of length 1"),
        ({"confidence": [1.5]}, "expected 0 to 1"),
        ({"centre": [[0, np.nan, 0.2]]}, "finite"),
    ],
)
def test_wrong_poses_are_refused(changes, told):
    with pytest.raises(InputError, match=told):
        PalmPath(**{"time": [0.0], **FLAT, **changes})


def test_times_increase():
    twice = {name: 2 * value for name, value in FLAT.items()}
    with pytest.raises(InputError, match=r"increasing times, got 0\.1 s at pose 2"):
        PalmPath(time=[0.1, 0.1], **twice)


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
