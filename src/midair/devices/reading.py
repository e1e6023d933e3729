"""Combine the blocks of a sensor into frames without gaps."""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.devices.interface import FrameBlock, SensorDevice
from midair.errors import DeviceError

LONGEST = 60.0
"""Longest gap that is filled, in s; a longer one means that the sensor restarted."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilledBlock:
    """Frames without a gap."""

    samples: Array
    """Shape (frame, row, column): first copies of the last frame before the gap, then the frames of the block."""
    first: int
    """Index of the first frame."""
    lost: int
    """Number of copies at the start."""


class GapFiller:
    """Combines blocks; lost frames repeat the last one before them, so that frame i stays at i / rate (in Hz)."""

    def __init__(self, name: str, rate: float) -> None:
        self._name, self._rate = name, rate
        self.frames = 0
        """Number of frames so far, including filled ones."""
        self._last: Array | None = None

    def add(self, block: FrameBlock) -> FilledBlock:
        """Return the block, preceded by copies for the frames lost before it.

        Raises DeviceError if a frame index repeats, or more than a minute of frames is missing.
        """
        lost = block.first - self.frames
        if lost < 0 or lost > LONGEST * self._rate:
            raise DeviceError(
                f"{self._name}: expected frame {self.frames} or one soon after, got frame {block.first}; "
                "the sensor restarted; check its power and cable and record again"
            )
        samples, first = block.samples, self.frames
        if len(samples):
            held = samples[:1] if self._last is None else self._last
            self._last = np.array(samples[-1:])
            self.frames = block.first + len(samples)
            if lost:
                samples = np.concatenate([np.broadcast_to(held, (lost, *held.shape[1:])), samples])
        return FilledBlock(samples=samples, first=first, lost=lost if len(samples) else 0)


def read_frames(sensor: SensorDevice, frames: int) -> Array:
    """Return the first `frames` frames after a start, shape (frame, row, column).

    Raises DeviceError if the sensor loses frames or ends early.
    """
    parts, have = list[Array](), 0
    while have < frames:
        part = sensor.read(frames - have)
        if part.overflow or part.first != have:
            raise DeviceError(
                f"{sensor.name}: lost frames before {have / sensor.rate:.3f} s; close other programs and try again"
            )
        if not len(part.samples):
            raise DeviceError(f"{sensor.name}: expected {frames} frames, got {have}; check the connection")
        parts.append(part.samples)
        have += len(part.samples)
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
