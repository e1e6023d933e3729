"""State and result of a take, and the interfaces of its observers."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from midair.errors import MidairError
from midair.files import OpenedTake
from midair.model import Event, StageStamp
from midair.rig.takes.clocks import Drift
from midair.rig.takes.meters import Levels

TakeOrder = Literal["toggle", "quit", "kill"]
"""User command: start or stop this take; stop, and make no more takes; stop because of a signal."""
EndReason = Literal["duration", "source", "toggle", "quiet", "quit", "kill", "companion", "failure"]
"""Reason for the end of a take: duration reached, end of the source, key, silence, quit, signal, end of the companion,
or failure."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """State of a running take, for display."""

    state: Literal["waiting", "recording"]
    frames: int
    """Number of recorded frames so far."""
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
    """Path of the recording; None without a file, or if the take ended before it began."""
    memory: OpenedTake | None
    """The recording, if it was made without a file."""
    frames: int
    """Number of recorded frames."""
    lost: int
    """Number of replaced frames among them."""
    end: EndReason
    """Reason for the end."""
    error: MidairError | None
    """Error that ended the take, if any."""
    levels: Levels
    lowest: float
    """Lowest recorded sample, in the sensor's unit."""
    highest: float
    """Highest recorded sample, in the sensor's unit."""
    rate: Drift | None
    clock: Drift | None

    @property
    def problem(self) -> str:
        """Message of the error that ended the take, or ""."""
        return "" if self.error is None else str(self.error)


class Watcher(Protocol):
    """User interface of a take."""

    def order(self) -> TakeOrder | None:
        """Command since the last call."""
        ...

    def show(self, view: View) -> None:
        """Display the state; called for every block."""
        ...

    def tell(self, event: Event, drift: Drift | None = None, /) -> None:
        """Report an event; its frame is counted from the sensor's start. A DeviceError that it raises ends the take."""
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
