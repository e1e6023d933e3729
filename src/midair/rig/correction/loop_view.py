"""Interactive view of a loop: the recording, the emitted sound, and the re-recording."""

import numpy as np

from midair.model import PressureFrames
from midair.rig.correction.correction_loop import Loop
from midair.targets import frames_without_lead
from midair.view import Sound, ViewData, show_comparison, show_drive

LONGEST = 4000
"""Maximum number of frames in the view of a report, about 6 MB."""


def view_of_loop(loop: Loop, *, longest: int = LONGEST) -> ViewData:
    """Return the view of the beginning of a loop: recording, last drive and re-recording."""
    last = loop.passes[-1]
    seconds = min(longest, loop.original.frames) / loop.original.rate
    return show_comparison(loop.original, last.felt, sound=_sound(loop, seconds), part=(0.0, seconds))


def _sound(loop: Loop, seconds: float) -> Sound | None:
    """Sound of the original's part, without its lead; None where its frames differ from the recording's."""
    made = loop.passes[-1].reproduction
    inside = frames_without_lead(made.target.provenance, made.target.frames, made.target.rate)
    if not _same_frames(loop.original, inside, made.target.rate):
        return None
    return show_drive(made.solution, target=made.target, part=(inside.start / made.target.rate, seconds)).sound


def _same_frames(original: PressureFrames, inside: slice, rate: float) -> bool:
    return bool(np.isclose(original.rate, rate, rtol=1e-9)) and inside.stop - inside.start == original.frames
