"""What a stream of channels is, wherever it comes from: what `StreamedSensor` needs of a source, and no more."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.lazy_frames import Stored
from midair.model import Unit

Samples = NDArray[Any]
"""Shape (frame, channel), of any number type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """What a source turned out to be once it was opened.

    Attributes
    ----------
    channels : int
        In a frame.
    rate : float
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"} or None
        Unit of sample * scale; None when the source knows only its own numbers.
    scale : float
        How much of `unit` one of the source's numbers is.
    full_scale : float or None
        Magnitude at which the source clips, in its own numbers.
    stored : {"f4", "f8"}
        Whether float32 holds every number of the source.
    """

    channels: int
    rate: float
    unit: Unit | None = None
    scale: float = 1.0
    full_scale: float | None = None
    stored: Stored = "f8"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chunk:
    """Consecutive frames of all channels.

    Attributes
    ----------
    samples : ndarray, shape (frame, channel)
        In the source's own numbers.
    first : int
        Index of the first frame since start, lost ones counted.
    device_time, host_time : float
        As in `Block`, in s.
    """

    samples: Samples
    first: int
    device_time: float
    host_time: float

    def __len__(self) -> int:
        return len(self.samples)

    def part(self, begin: int, end: int, rate: float) -> "Chunk":
        """Frames `begin` to `end` of the chunk, by its own count."""
        return replace(
            self,
            samples=self.samples[begin:end],
            first=self.first + begin,
            device_time=self.device_time + begin / rate,
            host_time=self.host_time + begin / rate,
        )

    def finite_parts(self, rate: float) -> "Iterator[Chunk]":
        """The runs of frames without NaN or infinity, with which some programs say that a frame is missing."""
        whole = np.isfinite(self.samples).all(axis=1)
        if whole.all():
            yield self
            return
        # A frame that is missing on either side gives every run a beginning and an end.
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            yield self.part(int(begin), int(end), rate)


class Source(Protocol):
    """Channels that are sampled somewhere; all errors are `MidairError`.

    `open`, `start`, `stop` and `close` are called from one thread, `pull` from another between `start` and `stop`.
    """

    def open(self) -> Stream:
        """Take hold of it and say what it is."""
        ...

    def start(self) -> None:
        """Begin: frame 0 is the first one after this. What came before is thrown away."""
        ...

    def pull(self, wait: float) -> Chunk | None:
        """What came since the last call, or the first that comes within `wait` seconds; None if nothing does."""
        ...

    def stop(self) -> None:
        """End sampling. Harmless when not started."""
        ...

    def close(self) -> None:
        """Let go. Harmless when not open."""
        ...

    def describe(self) -> dict[str, str]:
        """What it says of itself, and what it counted since start, in words."""
        ...
