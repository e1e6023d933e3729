"""What of a loop can be watched and heard: the recording, the sound that was played, and what was felt of it."""

import numpy as np

from midair.model import PressureFrames
from midair.rig.correction.correction_loop import Loop
from midair.targets import piece_of
from midair.view import Sound, ViewData, show_comparison, show_drive

LONGEST = 4000
"""Frames that a report holds to be watched: they weigh some 6 MB."""


def view_of_loop(loop: Loop, *, longest: int = LONGEST) -> ViewData:
    """The beginning of a loop's recording, its last drive and what was felt of it."""
    last = loop.passes[-1]
    seconds = min(longest, loop.original.frames) / loop.original.rate
    return show_comparison(loop.original, last.felt, sound=_sound(loop, seconds), part=(0.0, seconds))


def _sound(loop: Loop, seconds: float) -> Sound | None:
    """What was played of the piece, without its lead; None where it has other frames than the recording."""
    made = loop.passes[-1].reproduction
    inside = piece_of(made.target.provenance, made.target.frames, made.target.rate)
    if not _as_many(loop.original, inside, made.target.rate):
        return None
    return show_drive(made.solution, target=made.target, part=(inside.start / made.target.rate, seconds)).sound


def _as_many(original: PressureFrames, inside: slice, rate: float) -> bool:
    return bool(np.isclose(original.rate, rate, rtol=1e-9)) and inside.stop - inside.start == original.frames
