"""Pieces of a recording, solved without the frames before them, are bit-identical to the whole."""

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Provenance, TransducerArray
from midair.solvers import Glide, Guard, solve, solve_parts, solve_piece
from midair.solvers.glide import pieces

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
