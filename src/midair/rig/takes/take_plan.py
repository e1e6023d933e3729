"""Plan, display state and result of a take, and the interfaces of its observers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from midair.errors import InputError
from midair.model import Event, Setting, StageStamp
from midair.rig.takes.clocks import Drift
from midair.rig.takes.meters import Levels
from midair.validation import positive

TakeOrder = Literal["toggle", "quit", "kill"]
"""User command: start or stop this take; stop, and make no more takes; stop because of a signal."""
EndReason = Literal["duration", "source", "toggle", "quiet", "quit", "kill", "companion", "failure"]
"""Reason for the end of a take: duration reached, end of the source, key, silence, quit, signal, end of the companion,
or failure."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakePlan:
    """Start and end conditions of a take."""

    path: Path
    """Path of the recording; an existing file is not overwritten."""
    start: Literal["at once", "key", "touch"] = "at once"
    """Start condition."""
    duration: float | None = None
    """Duration from the start in s; None for no limit."""
    level: float | None = None
    """Threshold of a touch: deviation of any channel from rest, in the sensor's unit."""
    pre_roll: float = 0.0
    """Time before the start that is kept, in s."""
    post_roll: float | None = None
    """Time without a touch after which the take ends, in s."""
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    """Object, surface, speed, operator."""
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])
    """Settings of the step "record" in the provenance, such as the number of the take."""
    block: float = 0.05
    """Duration of one read in s; with `interval` and the time of a write it stays below a quarter of a second, the most
    that is lost when the program is killed."""
    interval: float = 0.1
    """Longest time before a frame is flushed, in s."""

    def __post_init__(self) -> None:
        if self.duration is not None:
            positive(self.duration, "duration", "s")
        if self.level is not None:
            positive(self.level, "level of the trigger")
        if not 0 <= self.pre_roll <= 60:
            raise InputError(f"pre-roll: expected 0 to 60 s, got {self.pre_roll:g} s")
        if self.post_roll is not None:
            positive(self.post_roll, "post-roll", "s")
        if self.level is None and (self.start == "touch" or self.post_roll is not None):
            raise InputError("trigger: expected a level for a take that waits for a touch or for silence, got none")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """State of a running take, for display."""

    state: Literal["waiting", "recording"]
    frames: int
    """Number of frames in the file so far."""
    wanted: int | None
    """Planned number of frames, if known."""
    lost: int
    """Number of lost frames since the sensor's start."""
    levels: Levels
    rate: Drift | None
    """Drift of the frame count against this computer's clock."""
    clock: Drift | None
    """Drift of the device's clock against this computer's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Take:
    """Result of a take."""

    path: Path | None
    """Path of the recording; None if the take ended before it began."""
    frames: int
    """Number of frames in the file."""
    lost: int
    """Number of replaced frames among them."""
    end: EndReason
    """Reason for the end."""
    problem: str
    """Error message, if an error ended the take."""
    levels: Levels
    lowest: float
    """Lowest sample in the file, in the sensor's unit."""
    highest: float
    """Highest sample in the file, in the sensor's unit."""
    rate: Drift | None
    clock: Drift | None


class Watcher(Protocol):
    """User interface of a take."""

    def order(self) -> TakeOrder | None:
        """Command since the last call."""
        ...

    def show(self, view: View) -> None:
        """Display the state; called for every block."""
        ...

    def tell(self, event: Event, drift: Drift | None = None) -> None:
        """Report an event; its frame is counted from the sensor's start."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CompanionReport:
    """Report of a companion since the last call; times in s by this computer's monotonic clock."""

    stamps: tuple[StageStamp, ...] = ()
    """Positions of the stage."""
    strokes: tuple[tuple[float, float], ...] = ()
    """(start, end) of each stroke, complete or not."""
    over: bool = False
    """Whether it has finished, which ends the take."""
    problem: str = ""
    """Error message, if any."""


class Companion(Protocol):
    """A task that runs during a take from its first frame, such as the motion of a stage."""

    def begin(self) -> None:
        """Start; the first frame is in the file."""
        ...

    def news(self) -> CompanionReport:
        """Report since the last call, without waiting."""
        ...

    def end(self) -> None:
        """Stop, since the take is over; allowed at any time and repeatedly."""
        ...
