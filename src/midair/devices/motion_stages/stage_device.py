"""What a stage can do, whoever made it.

A stage is a context manager: entering opens it and moves nothing, leaving closes it. A new one is a subclass in a file
of its own.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Self

from midair.model import Place, StageStamp


class StageDevice(ABC):
    """A machine that moves in straight lines and says where it is.

    Attributes
    ----------
    name : str
        What it was opened by, such as ``grbl:/dev/ttyUSB0``.
    """

    name: str

    @abstractmethod
    def open(self) -> None:
        """Take hold of the machine; nothing moves."""

    @abstractmethod
    def ready(self, *, homing: bool) -> StageStamp:
        """Where it stands, if it is at rest, is not locked, and knows where it is.

        Parameters
        ----------
        homing : bool
            Whether it has to have switches by which it found out.

        Raises
        ------
        DeviceError
            If it does not; the message says what to do.
        """

    @abstractmethod
    def home(self, stopped: Callable[[], bool]) -> None:
        """Let it find its switches. It moves.

        Raises
        ------
        DeviceError
            If it does not find them.
        """

    @abstractmethod
    def check_speed(self, speed: float, way: float, axis: int) -> None:
        """Raise unless it can go so fast (m/s) over at least half of a way (m) along an axis.

        Raises
        ------
        InputError
            If it cannot.
        """

    @abstractmethod
    def move(
        self, target: Place, speed: float, *, stamp: Callable[[StageStamp], object], stopped: Callable[[], bool]
    ) -> tuple[float, float] | None:
        """Go straight to a place, and return when it is there.

        However it is left before, the machine is held first: it slows down and stands, and forgets where it was going.

        Parameters
        ----------
        target : tuple of float
            x, y, z in the machine's coordinates, in m.
        speed : float
            In m/s.
        stamp : callable
            Called with every place that the machine tells of on its way.
        stopped : callable
            Asked all the time; once it says True the machine is held.

        Returns
        -------
        tuple of float or None
            When it began and when it was there, by this computer's steady clock; None if it was stopped.

        Raises
        ------
        DeviceError
            If the machine gives an alarm, refuses, is silent, or is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the machine. Harmless when not open."""

    def describe(self) -> dict[str, str]:
        """What it says of itself, in words."""
        return {}

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
