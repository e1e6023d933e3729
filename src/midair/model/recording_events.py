"""Events during a recording: lost frames, clipped or constant channels, clock deviations."""

from dataclasses import dataclass
from typing import Literal

EventKind = Literal["lost", "clipped", "dead", "stuck", "rate", "clock", "trigger", "stroke", "mended", "late"]
"""lost: frames that did not arrive; the last good one was repeated. clipped, dead, stuck: faults of a channel. rate:
frames counted against this computer's clock. clock: the device's clock against this computer's. trigger: the frame that
started the recording. stroke: frames of a stroke of a motion stage. mended: missing frames of a channel that were
filled. late: frames of live touch that were not played in time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event in a recording."""

    kind: EventKind
    frame: int
    """First frame that it concerns, from 0."""
    frames: int = 0
    """Number of frames that it concerns."""
    channel: int = -1
    """Channel of the sensor; -1 for all."""
    ppm: float = 0.0
    """Deviation from this computer's clock (kinds rate and clock), in parts per million; positive if faster."""
