"""The moves of the recording solver, one at a time."""

import numpy as np
import pytest

from midair.solvers import Glide
from midair.solvers.backend import backend
from midair.solvers.glide.frame_block import FrameBlock, marks_of


@pytest.fixture(scope="module")
def glider(problem_of, moving_spot):
    # Double precision: what is compared is the moves, not their rounding.
    return Glide()._glider(problem_of(moving_spot(40)), backend("numpy", precision="double"))


@pytest.fixture(scope="module")
def around(glider):
    """What is known of frame 10, between 0 and 20."""
    efforts = Glide()._efforts()
    stretch = FrameBlock(glider, efforts, np.arange(21))
    stretch.known.put(np.array([0, 20]), marks_of(glider, efforts, np.array([0, 20])))
    return stretch._around(np.array([[0, 10, 20]]))


@pytest.fixture
def batch(glider):
    return glider.machine.batch(np.array([10]), faintest=1e-12)


def error(glider, batch, theta):
    return np.sqrt(2 * glider.machine.phase_function(batch)(theta)[0][0])


def test_the_mean_of_the_neighbours_is_what_it_says(glider, around):
    p = glider.machine.problem.amplitude / np.linalg.norm(glider.machine.problem.amplitude, axis=1, keepdims=True)
    np.testing.assert_allclose(around.p[0], (p[0] + p[20]) / 2)
    # The target is a part of their mean and something that no part of it is: they stand at right angles.
    np.testing.assert_allclose(around.part[0] * around.p[0] + around.missed[0], p[10])
    assert abs(around.p[0] @ around.missed[0]) < 1e-12
    np.testing.assert_allclose(np.abs(around.q), 1)


def test_a_polish_from_the_neighbours_lowers_the_error(glider, around, batch):
    state = glider.begin(batch, around)
    before = np.sqrt(2 * state.cost[0])
    polished = glider.smooth(batch, around, state, 10)
    assert error(glider, batch, polished.theta) < 0.5 * before


def test_a_bent_frame_gets_closer_than_a_polish_of_as_many_iterations(glider, around, batch):
    bent = glider.bent(batch, around, (15, 9, 20), rough=False)
    polished = glider.smooth(batch, around, glider.begin(batch, around), 20)
    assert error(glider, batch, bent.theta) < error(glider, batch, polished.theta)


def test_admm_gets_a_rough_frame_closer(glider, around, batch):
    without = glider.bent(batch, around, (80, 9, 0), rough=False)
    split = glider.bent(batch, around, (80, 9, 0), rough=True)
    assert error(glider, batch, split.theta) < error(glider, batch, without.theta)


def test_a_frame_that_asks_for_too_much_gets_the_long_polish_and_keeps_its_place(problem_of, moving_spot):
    strengths = moving_spot(3)
    strengths[1] *= 12  # the middle one of three asks for more than all transducers have
    glider = Glide()._glider(problem_of(strengths), backend("numpy", precision="double"))
    batch = glider.machine.batch(np.arange(3), faintest=1e-12)
    a, q = np.zeros((3, glider.machine.drive.shape[0]), complex), np.ones((3, 996), complex)
    a[1, 0] = 40.0
    state = glider._after_split(batch, a, q, np.full(3, 1e-3), 0)
    soft = glider._after_split(batch.some(np, np.array([0, 2])), a[[0, 2]], q[[0, 2]], np.full(2, 1e-3), 0)
    np.testing.assert_allclose(state.x[[0, 2]], soft.x)
    assert np.abs(state.x[1]).max() > 0  # polished although no iterations were asked for the others


def test_the_field_that_is_kept_is_the_one_that_the_phases_make(glider, around, batch):
    machine = glider.machine
    solved = glider.smooth(batch, around, glider.begin(batch, around), 10)
    heard = (solved.z @ glider.field.out)[0, : machine.problem.points]
    made = (np.exp(1j * solved.theta) @ machine.drive_back @ machine.field)[0, : machine.problem.points]
    np.testing.assert_allclose(heard, made * batch.gain[0, 0], rtol=1e-9)
