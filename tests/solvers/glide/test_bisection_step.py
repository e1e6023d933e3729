"""The steps of the recording solver, one at a time."""

import numpy as np
import pytest

from midair.solvers import Glide
from midair.solvers.backend import backend, taken
from midair.solvers.bisection_step import BisectionStep
from midair.solvers.glide import FrameBlock, solve_marks


@pytest.fixture(scope="module")
def bisection(problem_of, moving_spot):
    # Double precision, so that rounding does not affect the comparison.
    return BisectionStep.of(Glide(), problem_of(moving_spot(40)), backend("numpy", precision="double"))


@pytest.fixture(scope="module")
def around(bisection):
    """Neighbours of frame 10: frames 0 and 20."""
    block_frames = FrameBlock(Glide(), bisection, np.arange(21))
    block_frames.known.put(np.array([0, 20]), solve_marks(Glide(), bisection, np.array([0, 20])))
    return block_frames.neighbours(np.array([[0, 10, 20]]))


@pytest.fixture
def batch(bisection):
    return bisection.operators.batch(np.array([10]), faintest=1e-12)


def error(bisection, batch, theta):
    return np.sqrt(2 * bisection.operators.phase_function(batch)(theta)[0][0])


def test_the_mean_of_the_neighbours_has_the_stated_values(bisection, around):
    p = bisection.operators.problem.amplitude / np.linalg.norm(
        bisection.operators.problem.amplitude, axis=1, keepdims=True
    )
    np.testing.assert_allclose(around.p[0], (p[0] + p[20]) / 2)
    # The target is a multiple of their mean plus an orthogonal part.
    np.testing.assert_allclose(around.part[0] * around.p[0] + around.missed[0], p[10])
    assert abs(around.p[0] @ around.missed[0]) < 1e-12
    np.testing.assert_allclose(np.abs(around.q), 1)


def test_a_polish_from_the_neighbours_lowers_the_error(bisection, around, batch):
    state = bisection.begin(batch, around)
    before = np.sqrt(2 * state.cost[0])
    polished = bisection.refine_mean(batch, around, state, 10)
    assert error(bisection, batch, polished.theta) < 0.5 * before


def test_a_bent_frame_gets_closer_than_a_polish_of_as_many_iterations(bisection, around, batch):
    bent = bisection.from_field(batch, around, (15, 9, 20), rough=False)
    polished = bisection.refine_mean(batch, around, bisection.begin(batch, around), 20)
    assert error(bisection, batch, bent.theta) < error(bisection, batch, polished.theta)


def test_admm_gets_a_rough_frame_closer(bisection, around, batch):
    without = bisection.from_field(batch, around, (80, 9, 0), rough=False)
    split = bisection.from_field(batch, around, (80, 9, 0), rough=True)
    assert error(bisection, batch, split.theta) < error(bisection, batch, without.theta)


def test_a_frame_that_asks_for_too_much_gets_the_long_polish_and_keeps_its_place(problem_of, moving_spot):
    strengths = moving_spot(3)
    strengths[1] *= 12  # the middle one of three asks for more than all transducers have
    bisection = BisectionStep.of(Glide(), problem_of(strengths), backend("numpy", precision="double"))
    batch = bisection.operators.batch(np.arange(3), faintest=1e-12)
    a, q = np.zeros((3, bisection.operators.drive.shape[0]), complex), np.ones((3, 996), complex)
    a[1, 0] = 40.0
    state = bisection.refine_with_admm(batch, a, q, np.full(3, 1e-3), 0)
    soft = bisection.refine_with_admm(taken(np, batch, np.array([0, 2])), a[[0, 2]], q[[0, 2]], np.full(2, 1e-3), 0)
    np.testing.assert_allclose(state.x[[0, 2]], soft.x)
    assert np.abs(state.x[1]).max() > 0  # polished although no iterations were asked for the others


def test_the_field_that_is_kept_is_the_one_that_the_phases_make(bisection, around, batch):
    operators = bisection.operators
    solved = bisection.refine_mean(batch, around, bisection.begin(batch, around), 10)
    heard = (solved.z @ bisection.field.out)[0, : operators.problem.points]
    made = (operators.drive.to_modes(np.exp(1j * solved.theta)) @ operators.field)[0, : operators.problem.points]
    np.testing.assert_allclose(heard, made * batch.gain[0, 0], rtol=1e-9)
