"""The interface of a source of channels, which `StreamedSensor` uses."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from midair.errors import DeviceStateError
from midair.model import SensorGrid, SensorWiring, Unit
from midair.streaming import Stored
from midair.validation import setting

T = TypeVar("T")

Samples = NDArray[Any]
"""Shape (frame, channel), of any number type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """Properties of a source, known once it is open."""

    channels: int
    """Number of channels in a frame."""
    rate: float
    """Frames per second, in Hz."""
    unit: Unit | None = None
    """Unit of sample * scale; None if the source has only raw numbers."""
    scale: float = 1.0
    full_scale: float | None = None
    """Magnitude at which the source clips, in raw numbers."""
    stored: Stored = "f8"
    """Type for storage: "f4" if float32 represents every number of the source exactly."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chunk:
    """Consecutive frames of all channels."""

    samples: Samples
    """Raw numbers of the source, shape (frame, channel)."""
    first: int
    """Index of the first frame since start, including lost frames."""
    device_time: float
    """Both times as in `FrameBlock`, in s."""
    host_time: float
    uncertain: bool = False
    """True if an unknown number of frames may be missing before it."""

    def __len__(self) -> int:
        return len(self.samples)

    def part(self, begin: int, end: int, rate: float) -> "Chunk":
        """Frames `begin` to `end` of the chunk, counted from its start."""
        return replace(
            self,
            samples=self.samples[begin:end],
            first=self.first + begin,
            device_time=self.device_time + begin / rate,
            host_time=self.host_time + begin / rate,
            uncertain=self.uncertain and begin == 0,
        )

    def finite_parts(self, rate: float) -> "Iterator[Chunk]":
        """Runs of frames without NaN or infinity, with which some programs mark missing frames."""
        whole = np.isfinite(self.samples).all(axis=1)
        if whole.all():
            yield self
            return
        # Padding with a missing frame on either side gives every run a beginning and an end.
        edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            yield self.part(int(begin), int(end), rate)


class Source(Protocol):
    """Sampled channels; all errors are `MidairError`.

    `open`, `start`, `stop` and `close` are called from one thread, `pull` from another between `start` and `stop`.
    """

    def open(self) -> Stream:
        """Open the source and return its properties."""
        ...

    def start(self) -> None:
        """Start sampling and discard earlier data: frame 0 is the first one after this call."""

    def pull(self, wait: float) -> Chunk | None:
        """Return the frames since the last call, waiting up to `wait` seconds for the first; None if there are none."""
        ...

    def stop(self) -> None:
        """Stop sampling; no effect if not started."""

    def close(self) -> None:
        """Close the source; no effect if not open."""

    def describe(self) -> dict[str, str]:
        """Information about the source and counters since start, by name."""
        ...


def opened(part: T | None, kind: str) -> T:
    """A part of a source that exists while it is open; DeviceStateError before."""
    if part is None:
        raise DeviceStateError(f"{kind}: expected open first")
    return part


def above_zero(default: float | None, about: str, unit: str = "") -> Any:
    """Declare an option above 0."""
    return setting(default, about, unit=unit, limits=(0, np.inf), above=True)


@dataclass(frozen=True, kw_only=True)
class SensorOptions(ABC):
    """A kind of live sensor, with the options that may follow the question mark of its name.

    A driver subclasses it: further fields are further options, and `source` makes the source. The class is registered
    under the kind, the part of a name before the colon.
    """

    package: ClassVar[str] = ""
    """Package that the driver needs, for `midair doctor`."""
    has_default: ClassVar[bool] = False
    """Whether a name without a place means a default device."""

    unit: Unit | None = None
    full_scale: float | None = above_zero(None, "Magnitude at which it clips, in its unit.")
    sensitivity: float | None = None
    rows: int | None = above_zero(None, "Rows of cells.")
    columns: int | None = above_zero(None, "Columns of cells.")
    pitch_mm: float | None = above_zero(None, "Distance between cells.", "mm")
    rate: float | None = above_zero(None, "Frame rate; a faster source is filtered and decimated.", "Hz")
    timeout: float = above_zero(2.0, "Time without a frame after which the sensor is lost.", "s")

    @abstractmethod
    def source(self, place: str) -> Source:
        """Source at a place, the part of a name between colon and question mark; not open yet."""

    @classmethod
    def available(cls) -> str:
        """Devices that were found, in one line for `midair doctor`."""
        return ""

    def wire(self, stream: Stream, wiring: SensorWiring | None, name: str) -> SensorWiring:
        """Wiring of the sensor: from these options, else from the sensor file, else from the stream."""
        base = wiring or SensorWiring.for_channels(stream.channels, name=name, unit=stream.unit or "count")
        rows, columns = self.rows or base.grid.rows, self.columns or base.grid.columns
        pitch = base.grid.pitch if self.pitch_mm is None else self.pitch_mm * 1e-3
        # The order of the file is for its own cells.
        same = (rows, columns) == base.grid.shape
        return SensorWiring(
            grid=SensorGrid(rows=rows, columns=columns, pitch=pitch, name=base.grid.name),
            order=base.order if same else (),
            unit=self.unit or base.unit,
            full_scale=self.full_scale or base.full_scale,
            sensitivity=self.sensitivity or base.sensitivity,
        )
