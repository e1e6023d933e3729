"""A block of frames: each kind of frame gets its number of iterations, and marks do not change."""

from dataclasses import replace

import numpy as np
import pytest

from midair.solvers import Glide
from midair.solvers.backend import backend
from midair.solvers.glide.frame_block import FrameBlock, solve_marks

FRAMES, MARKS = np.arange(33), np.array([0, 16, 32])


def walked(bisection, **changes):
    efforts = replace(Glide()._efforts(), **changes)
    block_frames = FrameBlock(bisection, efforts, FRAMES)
    block_frames.known.put(MARKS, solve_marks(bisection, efforts, MARKS))
    before = block_frames.known.theta[MARKS].copy()
    block_frames.solve(MARKS)
    assert np.array_equal(block_frames.known.theta[MARKS], before)
    return block_frames.known


@pytest.fixture(scope="module")
def bisection(problem_of, moving_spot):
    return Glide()._bisection(problem_of(moving_spot(33)), backend("numpy"))


def test_every_frame_is_solved(bisection):
    known = walked(bisection)
    assert known.iterations.all()
    assert known.theta.any(axis=1).all()
    assert np.isfinite(known.theta).all()


def test_where_any_start_is_near_enough_only_the_polish_runs(bisection):
    known = walked(bisection, near=10.0, wide=4, smooth=3, smooth_wide=7)
    between = np.setdiff1d(FRAMES, MARKS)
    # Neighbours four frames away or more: every fourth frame, the marks left out.
    expected = np.where(between % 4 == 0, 7, 3)
    assert np.array_equal(known.iterations[between], expected)


def test_where_no_start_is_near_and_everything_is_far_all_get_the_effort_of_rough_frames(bisection):
    known = walked(bisection, near=0.0, far=0.0, rough=(3, 2, 1))
    between = np.setdiff1d(FRAMES, MARKS)
    assert (known.iterations[between] == 3 + 2 + 1 + bisection.admm_iterations).all()


def test_batch_size_does_not_change_frames(problem_of, moving_spot):
    bisection = Glide()._bisection(problem_of(moving_spot(33)), backend("numpy", precision="double"))
    few = {"cold": (8, 2, 4), "near": 9.0, "smooth": 3, "smooth_wide": 3}
    together, alone = (walked(bisection, rows=rows, **few).theta for rows in (128, 1))
    # Few iterations and double precision, before rounding separates descents of other batch sizes.
    np.testing.assert_allclose(np.exp(1j * alone), np.exp(1j * together), atol=1e-6)
