"""Blocks: each frame is solved once, after its neighbours."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.solvers import Glide
from midair.solvers.backend import backend
from midair.solvers.bisection_step import BisectionStep
from midair.solvers.glide import FrameBlock, blocks, midpoints, solve_marks

SIZES = {"frames": st.integers(1, 400), "coarse": st.integers(1, 40), "size": st.integers(1, 150)}


@given(**SIZES)
def test_all_frames_are_solved_once_and_after_their_neighbours(frames, coarse, size):
    times = np.zeros(frames, int)
    for block in blocks(frames, coarse=coarse, size=size):
        times[block.marks] += 1
        marks = block.marks if block.leads else np.concatenate([[block.first], block.marks])
        assert times[marks].all()
        for level in midpoints(marks):
            assert times[level[:, [0, 2]]].all()
            assert (np.diff(level, axis=1) > 0).all()
            times[level[:, 1]] += 1
    assert (times == 1).all()


@given(**SIZES)
def test_marks_are_no_farther_apart_than_was_asked(frames, coarse, size):
    marks = np.concatenate([block.marks for block in blocks(frames, coarse=coarse, size=size)])
    assert marks[0] == 0
    assert marks[-1] == frames - 1
    assert np.diff(marks).max(initial=0) <= coarse


@pytest.mark.parametrize("frames", [100, 101, 160])
def test_whole_blocks_do_not_depend_on_later_frames(frames):
    short = list(blocks(frames, coarse=10, size=40))[:2]
    long = list(blocks(1000, coarse=10, size=40))[:2]
    for one, other in zip(short, long, strict=True):
        assert (one.first, one.last) == (other.first, other.last)
        assert np.array_equal(one.marks, other.marks)


def test_the_first_block_is_as_short_as_was_asked():
    first, second, *_ = blocks(5000, coarse=512, size=1024, opening=256)
    assert (first.last, first.marks.tolist(), second.marks.tolist()) == (256, [0, 256], [768, 1280])


def test_a_block_begins_where_the_one_before_it_ends():
    every = list(blocks(1000, coarse=32, size=100))
    assert [one.last for one in every[:-1]] == [one.first for one in every[1:]]
    assert [one.leads for one in every] == [True] + [False] * (len(every) - 1)


FRAMES, MARKS = np.arange(33), np.array([0, 16, 32])


def walked(bisection, **changes):
    settings = replace(bisection.settings, **changes)
    bisection = replace(bisection, settings=settings)
    block_frames = FrameBlock(settings, bisection, FRAMES)
    block_frames.known.put(MARKS, solve_marks(settings, bisection, MARKS))
    before = block_frames.known.theta[MARKS].copy()
    block_frames.solve(MARKS)
    assert np.array_equal(block_frames.known.theta[MARKS], before)
    return block_frames.known


@pytest.fixture(scope="module")
def bisection(problem_of, moving_spot):
    return BisectionStep.of(Glide(), problem_of(moving_spot(33)), backend("numpy"))


@pytest.mark.long
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


@pytest.mark.long
def test_where_no_start_is_near_and_everything_is_far_all_get_the_effort_of_rough_frames(bisection):
    known = walked(bisection, near=0.0, far=0.0, rough=(3, 2, 1))
    between = np.setdiff1d(FRAMES, MARKS)
    assert (known.iterations[between] == 3 + 2 + 1 + Glide().split).all()


def test_batch_size_does_not_change_frames(problem_of, moving_spot):
    bisection = BisectionStep.of(Glide(), problem_of(moving_spot(33)), backend("numpy", precision="double"))
    few = {"cold": (8, 2, 4), "near": 9.0, "smooth": 3, "smooth_wide": 3}
    together, alone = (walked(bisection, rows=rows, **few).theta for rows in (128, 1))
    # Few iterations and double precision, before rounding separates descents of other batch sizes.
    np.testing.assert_allclose(np.exp(1j * alone), np.exp(1j * together), atol=1e-6)
