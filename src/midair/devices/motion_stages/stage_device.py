"""Interface of motion stages.

A stage is a context manager: it opens on entry without moving, and closes on exit. To add a stage, write a subclass in
its own file.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Self

from midair.model import Place, StageStamp


class StageDevice(ABC):
    """A machine that moves in straight lines and reports its position."""

    name: str
    """The name that it was opened with, such as ``grbl:/dev/ttyUSB0``."""

    @abstractmethod
    def open(self) -> None:
        """Open the connection; nothing moves."""

    @abstractmethod
    def ready(self, *, homing: bool) -> StageStamp:
        """Return the position if the machine is at rest, not locked, and knows its position.

        `homing` is whether limit switches are required. Raises DeviceError if it is not ready; the message says what
        to do.
        """

    @abstractmethod
    def home(self, stopped: Callable[[], bool]) -> None:
        """Find the limit switches; the machine moves. Raises DeviceError if it does not find them."""

    @abstractmethod
    def check_speed(self, speed: float, way: float, axis: int) -> None:
        """Raise InputError unless it reaches a speed (m/s) over at least half of a distance (m) along an axis."""

    @abstractmethod
    def move(
        self, target: Place, speed: float, *, stamp: Callable[[StageStamp], object], stopped: Callable[[], bool]
    ) -> tuple[float, float] | None:
        """Move in a straight line to a position, and return on arrival.

        If the move ends early, also by an error, the machine is stopped first: it brakes and cancels the rest of the
        move.

        `target` is x, y, z in machine coordinates, in m, and `speed` is in m/s. `stamp` is called with every position
        that the machine reports; `stopped` is called continuously, and once it returns True the machine is stopped.

        Returns start and end time on this computer's monotonic clock, or None if it was stopped. Raises DeviceError if
        the machine reports an alarm, rejects the move, does not answer, or is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the connection; no effect if not open."""

    def describe(self) -> dict[str, str]:
        """Information about the machine, by name."""
        return {}

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
