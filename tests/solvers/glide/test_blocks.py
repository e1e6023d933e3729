"""Blocks: each frame is solved once, after its neighbours; pieces are bit-identical to the whole recording."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Provenance, TransducerArray
from midair.solvers import Glide, Guard, pieces, solve, solve_parts, solve_piece
from midair.solvers.backend import backend
from midair.solvers.glide_blocks import FrameBlock, blocks, midpoints, solve_marks

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
    bisection = replace(bisection, settings=replace(bisection.settings, **changes))
    block_frames = FrameBlock(bisection, FRAMES)
    block_frames.known.put(MARKS, solve_marks(bisection, MARKS))
    before = block_frames.known.theta[MARKS].copy()
    block_frames.solve(MARKS)
    assert np.array_equal(block_frames.known.theta[MARKS], before)
    return block_frames.known


@pytest.fixture(scope="module")
def bisection(problem_of, moving_spot):
    return Glide()._bisection(problem_of(moving_spot(33)), backend("numpy"))


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
    bisection = Glide()._bisection(problem_of(moving_spot(33)), backend("numpy", precision="double"))
    few = {"cold": (8, 2, 4), "near": 9.0, "smooth": 3, "smooth_wide": 3}
    together, alone = (walked(bisection, rows=rows, **few).theta for rows in (128, 1))
    # Few iterations and double precision, before rounding separates descents of other batch sizes.
    np.testing.assert_allclose(np.exp(1j * alone), np.exp(1j * together), atol=1e-6)


SMALL = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
UNIT = TransducerArray.autd3(columns=1, rows=1)
QUICK = Glide(coarse=8, block=16, cold=(20, 4, 10), smooth=3, smooth_wide=6, bent=(4, 4, 4), rough=(6, 4, 4))


def target(amplitude):
    return AmplitudeFrames(amplitude=np.asarray(amplitude), rate=500.0, grid=SMALL, provenance=Provenance())


def wave(frames=70):
    """Slow changes, silence at both ends and in the middle, and a frame that is like no other."""
    time, rng = np.arange(frames)[:, None], np.random.default_rng(5)
    amplitude = 2000 * (1.2 + np.sin(0.05 * time + rng.uniform(0, 6, 16)))
    amplitude[37] = 4000 * rng.uniform(size=16)
    amplitude[:3] = amplitude[17:22] = amplitude[30] = amplitude[-4:] = 0
    return amplitude


def solved_apart(amplitude, together, **settings):
    """Every piece on its own, the last one first."""
    every = list(pieces(settings["method"], amplitude.any(axis=1), together=together))
    made = {
        one.first: list(
            solve_piece(
                target(amplitude[one.first : one.last]),
                UNIT,
                marks=amplitude[one.marks],
                loudest=float(amplitude.max()),
                **settings,
            )
        )
        for one in reversed(every)
    }
    return [part for first in sorted(made) for part in made[first]]


@pytest.mark.long
@pytest.mark.parametrize(
    ("settings", "together"),
    [
        ({}, 2),
        ({"amplitudes": "bounded"}, 1),
        ({"robust": 3.0}, 1),
        ({"level": "auto", "guard": Guard(margin=2e-2, pitch=1e-2)}, 1),
    ],
    ids=["plain", "bounded", "robust", "auto and guard"],
)
def test_pieces_solved_apart_are_the_recording_to_the_last_bit(settings, together):
    amplitude = wave()
    whole = list(solve_parts(target(amplitude), UNIT, method=QUICK, **settings))
    apart = solved_apart(amplitude, together, method=QUICK, **settings)
    assert len(whole) >= 4
    for name in ("phase", "level"):
        ours, theirs = (np.concatenate([getattr(part.drive, name) for part in parts]) for parts in (apart, whole))
        np.testing.assert_array_equal(ours, theirs)
    for name in ("error", "iterations"):
        ours, theirs = (np.concatenate([getattr(part, name) for part in parts]) for parts in (apart, whole))
        np.testing.assert_array_equal(ours, theirs)
    assert sum((part.status for part in apart), ()) == sum((part.status for part in whole), ())


@pytest.mark.long
def test_pieces_equal_the_solution_of_the_whole():
    amplitude = wave()
    apart = solved_apart(amplitude, 1, method=QUICK)
    whole = solve(target(amplitude), UNIT, method=QUICK)
    np.testing.assert_array_equal(np.concatenate([part.drive.phase for part in apart]), whole.drive.phase)


def test_frames_are_counted_from_the_first_that_sounds_and_each_is_in_one_piece():
    sounds = np.ones(60, bool)
    sounds[[0, 1, 20]] = False
    found = [(one.first, one.last, one.marks.tolist()) for one in pieces(QUICK, sounds, together=1)]
    # Blocks of 16 sounding frames; the first also has its first mark.
    assert found == [(0, 19, []), (19, 36, [2, 10, 18]), (36, 52, [27, 35]), (52, 60, [43, 51])]
    assert [(one.first, one.last) for one in pieces(QUICK, sounds, together=3)] == [(0, 52), (52, 60)]


def test_silence_alone_is_one_piece():
    assert [(one.first, one.last) for one in pieces(QUICK, np.zeros(40, bool), together=1)] == [(0, 40)]


def test_other_methods_have_no_pieces():
    with pytest.raises(InputError, match="expected glide"):
        solve_piece(target(wave()), UNIT, marks=np.zeros((0, 16)), loudest=1.0, method="fast")
