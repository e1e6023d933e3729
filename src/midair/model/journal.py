"""What happened while a recording was made: lost frames, channels that clipped or stood still, clocks."""

from dataclasses import dataclass
from typing import Literal

EventKind = Literal["lost", "clipped", "dead", "stuck", "rate", "clock", "trigger", "stroke", "mended"]
"""lost: frames that never came, held at the last good one. clipped, dead, stuck: of a channel. rate: frames counted
against this computer's clock. clock: the device's clock against this computer's. trigger: the frame that started it.
stroke: frames of a stroke that a stage drew. mended: frames of a channel that were missing and were filled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    kind : {"lost", "clipped", "dead", "stuck", "rate", "clock", "trigger", "stroke", "mended"}
        What.
    frame : int
        First frame of the recording that it concerns, from 0.
    frames : int
        How many it concerns.
    channel : int
        Channel of the sensor; -1 for all.
    ppm : float
        How much faster than this computer's clock, for rate and clock, in millionths.
    """

    kind: EventKind
    frame: int
    frames: int = 0
    channel: int = -1
    ppm: float = 0.0
