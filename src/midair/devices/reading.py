"""Blocks of a sensor put together into frames without gaps: read as they come, or held where some were lost."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.devices.interface import FrameBlock, SensorDevice
from midair.errors import DeviceError

Array = NDArray[np.float64]

LONGEST = 60.0
"""Gap that is still bridged, in s; a longer one means that the sensor began anew."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilledBlock:
    """Frames of which none is missing.

    Attributes
    ----------
    samples : ndarray, shape (frame, row, column)
        The frames that were lost first, held at the last one before them, then those of the block.
    first : int
        Number of the first frame.
    lost : int
        How many of the frames are held ones; they come first.
    """

    samples: Array
    first: int
    lost: int


class GapFiller:
    """Puts blocks together; frames that never came are held at the last one that did: frame i stays at i / rate.

    Parameters
    ----------
    name : str
        Of the sensor, for messages.
    rate : float
        Frames per second, in Hz.
    """

    def __init__(self, name: str, rate: float) -> None:
        self._name, self._rate = name, rate
        self._next = 0
        self._last: Array | None = None

    @property
    def frames(self) -> int:
        """How many frames there are so far, held ones included."""
        return self._next

    def add(self, block: FrameBlock) -> FilledBlock:
        """The block with what was lost before it.

        Raises
        ------
        DeviceError
            If frames come a second time, or more than a minute of them is missing.
        """
        lost = block.first - self._next
        if lost < 0 or lost > LONGEST * self._rate:
            raise DeviceError(
                f"{self._name}: expected frame {self._next} or one soon after, got frame {block.first}; "
                "the sensor began anew, check its power and cable and record again"
            )
        samples, first = block.samples, self._next
        if len(samples):
            held = samples[:1] if self._last is None else self._last
            self._last = np.array(samples[-1:])
            self._next = block.first + len(samples)
            if lost:
                samples = np.concatenate([np.broadcast_to(held, (lost, *held.shape[1:])), samples])
        return FilledBlock(samples=samples, first=first, lost=lost if len(samples) else 0)


def fill_gaps(sensor: SensorDevice, frames: int, *, block: int | None = None) -> Iterator[Array]:
    """The first `frames` frames after a start, piece by piece; fewer if the source ends.

    Parameters
    ----------
    sensor : SensorDevice
        Started.
    frames : int
        At most.
    block : int, optional
        Frames that are asked for at once; all that are left if None.

    Yields
    ------
    ndarray, shape (frame, row, column)
        One after another, none missing.

    Raises
    ------
    DeviceError
        If the sensor loses frames.
    """
    have = 0
    while have < frames:
        part = sensor.read(min(block or frames, frames - have))
        if part.overflow or part.first != have:
            raise DeviceError(
                f"{sensor.name}: lost frames before {have / sensor.rate:.3f} s; close other programs, try again"
            )
        if not len(part.samples):
            return
        have += len(part.samples)
        yield part.samples


def read_frames(sensor: SensorDevice, frames: int) -> Array:
    """The first `frames` frames after a start, every one of them, shape (frame, row, column).

    Raises
    ------
    DeviceError
        If the sensor loses frames or ends before.
    """
    parts = list(fill_gaps(sensor, frames))
    have = sum(len(part) for part in parts)
    if have < frames:
        raise DeviceError(f"{sensor.name}: expected {frames} frames, got {have}; is it still connected?")
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
