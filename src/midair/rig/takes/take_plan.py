"""A take: how it begins and ends, what can be seen of it while it runs, and what came of it."""

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
"""What a person can say: start or stop this take; stop, and no more takes; stop, for a signal came."""
WarmStart = Literal["duration", "source", "toggle", "quiet", "quit", "kill", "companion", "failure"]
"""Why a take ended: its time was over, the source ended, a key, silence, the end of
what went on beside it, or what was in its way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakePlan:
    """How a take begins and ends.

    Attributes
    ----------
    path : Path
        Path of the recording to make; nothing is written over.
    start : {"at once", "key", "touch"}
        What it waits for.
    duration : float or None
        Time from the start on, in s; None until something else ends it.
    level : float or None
        Distance of any channel from its resting value that is a touch, in the sensor's unit.
    pre_roll : float
        How much from before the start is kept, in s.
    post_roll : float or None
        Without a touch for so long, in s, the take ends.
    notes : mapping of str to str
        Object, surface, speed, operator.
    settings : mapping
        Into the step "record" of the recording's provenance, such as the number of the take.
    block, interval : float
        Seconds that are read at a time, and longest time that a frame waits for a flush. Together with the time of a
        write they stay below a quarter of a second: that much is lost at most when the program is killed.
    """

    path: Path
    start: Literal["at once", "key", "touch"] = "at once"
    duration: float | None = None
    level: float | None = None
    pre_roll: float = 0.0
    post_roll: float | None = None
    notes: Mapping[str, str] = field(default_factory=dict[str, str])
    settings: Mapping[str, Setting] = field(default_factory=dict[str, Setting])
    block: float = 0.05
    interval: float = 0.1

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
    """What can be shown while a take runs.

    Attributes
    ----------
    state : {"waiting", "recording"}
        Whether it has begun.
    frames, wanted : int, int or None
        In the file so far, and in the end, if that is known.
    lost : int
        Frames that never came, since the sensor was started.
    levels : Levels
        Levels of the channels.
    rate, clock : Drift or None
        Drifts of the frames counted and of the device's clock, against this computer's.
    """

    state: Literal["waiting", "recording"]
    frames: int
    wanted: int | None
    lost: int
    levels: Levels
    rate: Drift | None
    clock: Drift | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Take:
    """What came of a take.

    Attributes
    ----------
    path : Path or None
        Path of the recording; None when it ended before it began.
    frames, lost : int
        In the file, and how many of them are held ones.
    end : str
        Why it ended.
    problem : str
        What was in its way, if that was the end.
    levels : Levels
        Levels of the channels.
    lowest, highest : float
        Lowest and highest of all samples in the file, in the sensor's unit.
    rate, clock : Drift or None
        As in `View`.
    """

    path: Path | None
    frames: int
    lost: int
    end: WarmStart
    problem: str
    levels: Levels
    lowest: float
    highest: float
    rate: Drift | None
    clock: Drift | None


class Watcher(Protocol):
    """Who looks on, and may say something."""

    def order(self) -> TakeOrder | None:
        """What was said since the last time."""
        ...

    def show(self, view: View) -> None:
        """Something has changed; called for every block."""
        ...

    def tell(self, event: Event, drift: Drift | None = None) -> None:
        """Something happened; its frame is counted from the sensor's start."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CompanionReport:
    """What a companion of a take has to say since the last time; times by this computer's steady clock.

    Attributes
    ----------
    stamps : tuple of StageStamp
        Where the stage was.
    strokes : tuple of pairs of float
        When strokes began and ended, whether whole or cut short.
    over : bool
        Whether it has come to its end, and the take with it.
    problem : str
        What was in its way, if anything.
    """

    stamps: tuple[StageStamp, ...] = ()
    strokes: tuple[tuple[float, float], ...] = ()
    over: bool = False
    problem: str = ""


class Companion(Protocol):
    """What goes on beside a take from its first frame on, such as a stage that moves."""

    def begin(self) -> None:
        """The first frame is in the file."""
        ...

    def news(self) -> CompanionReport:
        """What happened; never waits."""
        ...

    def end(self) -> None:
        """The take is over: come to rest. Harmless at any time, and a second time."""
        ...
