"""What of a loop can be watched and heard: the recording, the sound that was played, and what was felt of it."""

from dataclasses import dataclass

import numpy as np

from midair.model import PressureFrames
from midair.rig.looping.correction_loop import Loop
from midair.targets import piece_of
from midair.view import AudibleChannel, Showing, Sound, audible, inlined, show_comparison, show_drive

LONGEST = 4000
"""Frames that a report holds to be watched: they weigh some 6 MB."""

_SOUND_RATE = 8000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watch:
    """What a report holds to be watched and heard.

    Attributes
    ----------
    showing : Showing
        The recording, what was played, and what was felt of it.
    sounds : tuple of (str, AudibleChannel)
        What to call each, and how it sounds, all at one scale.
    """

    showing: Showing
    sounds: tuple[tuple[str, AudibleChannel], ...]

    def page(self) -> dict[str, str]:
        """Style, script and frames, for a template."""
        return inlined(self.showing)


def watched(loop: Loop, *, longest: int = LONGEST) -> Watch:
    """The beginning of a loop's recording, its last drive and what was felt of it, to be watched and heard."""
    last = loop.passes[-1]
    seconds = min(longest, loop.original.frames) / loop.original.rate
    shown = show_comparison(loop.original, last.felt, sound=_sound(loop, seconds), part=(0.0, seconds))
    return Watch(showing=shown, sounds=_sounds(shown))


def _sound(loop: Loop, seconds: float) -> Sound | None:
    """What was played of the piece, without its lead; None where it has other frames than the recording."""
    made = loop.passes[-1].reproduction
    inside = piece_of(made.target.provenance, made.target.frames, made.target.rate)
    if not _as_many(loop.original, inside, made.target.rate):
        return None
    return show_drive(made.solution, target=made.target, part=(inside.start / made.target.rate, seconds)).sound


def _as_many(original: PressureFrames, inside: slice, rate: float) -> bool:
    return bool(np.isclose(original.rate, rate, rtol=1e-9)) and inside.stop - inside.start == original.frames


def _sounds(shown: Showing) -> tuple[tuple[str, AudibleChannel], ...]:
    both = [each for each in (shown.samples, shown.again) if each is not None]
    alone = [audible(each, shown.channel, shown.rate, sound_rate=_SOUND_RATE) for each in both]
    scale = max(each.full_scale for each in alone)
    return tuple(
        (each.label, audible(each, shown.channel, shown.rate, sound_rate=_SOUND_RATE, full_scale=scale))
        for each in both
    )
