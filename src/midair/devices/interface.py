"""What a sensor and an array can do, whoever made them.

A device is a context manager: entering opens it, leaving stops and closes it, and leaving an array silences it first,
on errors too. A new device is a subclass in a file of its own that fills in the abstract methods.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import MismatchError
from midair.model import Calibration, Drive, SensorGrid, TransducerArray, Unit

Progress = Callable[[int, int], None]
"""Called with (done, total) as work goes on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """Consecutive frames as a sensor gave them.

    Attributes
    ----------
    samples : ndarray, shape (frame, row, column)
        In the sensor's unit.
    first : int
        Index of the first frame since start; a gap to the block before is lost frames.
    device_time, host_time : float
        Of the first frame by the device's clock and by this computer's, in s.
    overflow : bool
        Whether frames were lost before this block.
    """

    samples: NDArray[np.float64]
    first: int
    device_time: float
    host_time: float
    overflow: bool = False


class SensorDevice(ABC):
    """A pressure sensor that gives blocks of frames.

    Attributes
    ----------
    name : str
        What it was opened by, such as ``virtual:towel``.
    grid : SensorGrid
        Its cells.
    rate : float
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"}
        Of its samples.
    calibration : Calibration or None
        That it brings along.
    simulated : bool
        Whether what it gives is simulated.
    """

    name: str
    grid: SensorGrid
    rate: float
    unit: Unit
    calibration: Calibration | None = None
    simulated: bool = False

    @abstractmethod
    def open(self) -> None:
        """Take hold of the device."""

    @abstractmethod
    def start(self) -> None:
        """Begin to sample: frame 0 is the first one after this."""

    @abstractmethod
    def read(self, frames: int) -> Block:
        """The next frames, `frames` of them; fewer, or none, when the source has ended."""

    @abstractmethod
    def stop(self) -> None:
        """End sampling. Harmless when not started."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. Harmless when not open."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        self.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayReport:
    """What an array did with a drive: frames it played, and how many of them came late or were repeated."""

    frames: int
    duration: float
    late: int = 0
    repeated: int = 0


class ArrayDevice(ABC):
    """A phased array that plays drives and is silent at all other times.

    Attributes
    ----------
    name : str
        What it was opened by, such as ``virtual``.
    array : TransducerArray
        Its transducers; it plays phases made for them and refuses others.
    simulated : bool
        Whether it only pretends.
    """

    name: str
    array: TransducerArray
    simulated: bool = False

    @abstractmethod
    def open(self) -> None:
        """Take hold of the device; it is silent."""

    @abstractmethod
    def emit(self, drive: Drive, progress: Progress | None) -> PlayReport:
        """Put out every frame of a drive that `play` has checked; `play` silences afterwards."""

    @abstractmethod
    def silence(self) -> None:
        """Stop all sound at once. Harmless at any time."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. Harmless when not open."""

    def play(self, drive: Drive, *, progress: Progress | None = None) -> PlayReport:
        """Play a drive from its first frame to its last, then be silent, whatever happens on the way.

        Raises
        ------
        MismatchError
            If the drive was made for another array.
        DeviceStateError
            If the device is not open.
        """
        if not self.array.same_as(drive.array):
            raise MismatchError(
                f"drive: expected one for {self.array.name} ({self.array.count} transducers), got one for "
                f"{drive.array.name} ({drive.array.count} transducers); solve the target again for this array"
            )
        try:
            return self.emit(drive, progress)
        finally:
            self.silence()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.silence()
        finally:
            self.close()
