"""Uncalibrated samples of a sensor, events during their recording, and the wiring of channels to cells."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isqrt
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError, UnitError
from midair.model.geometry import SensorGrid
from midair.model.provenance import Provenance
from midair.model.reprs import counted, frames_and_duration, from_source, span, summary
from midair.validation import frozen_array, positive

Unit = Literal["V", "count", "Pa"]
"""Unit of a recording's samples."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Samples of a sensor grid."""

    samples: NDArray[np.float64]
    """Shape (frame, row, column), in `unit`."""
    rate: float
    """Frames per second, in Hz: frame i was sampled at i / rate."""
    sensor: SensorGrid = field(default_factory=SensorGrid)
    unit: Unit = "V"
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        axes = ("frame", self.sensor.rows, self.sensor.columns)
        object.__setattr__(self, "samples", frozen_array(self.samples, "samples", axes))
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))
        if self.unit not in get_args(Unit):
            raise UnitError(f"unit of the samples: expected one of {', '.join(get_args(Unit))}, got {self.unit!r}")

    def __repr__(self) -> str:
        return summary(
            self,
            frames_and_duration(self.frames, self.rate),
            self.sensor.spelled,
            span(self.samples, self.unit),
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.samples)

    @property
    def duration(self) -> float:
        """Number of frames divided by the rate, in s."""
        return self.frames / self.rate

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate


EventKind = Literal["lost", "clipped", "dead", "stuck", "rate", "clock", "trigger", "stroke", "mended", "late"]
"""lost: frames that did not arrive; the last good one was repeated. clipped, dead, stuck: faults of a channel. rate:
frames counted against this computer's clock. clock: the device's clock against this computer's. trigger: the frame that
started the recording. stroke: frames of a stroke of a motion stage. mended: missing frames of a channel that were
filled. late: frames of live touch that were not played in time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One event in a recording."""

    kind: EventKind
    frame: int
    """First frame that it concerns, from 0."""
    frames: int = 0
    """Number of frames that it concerns."""
    channel: int = -1
    """Channel of the sensor; -1 for all."""
    ppm: float = 0.0
    """Deviation from this computer's clock (kinds rate and clock), in parts per million; positive if faster."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorWiring:
    """Assignment of a source's channels to the cells of a sensor, with their unit and scale."""

    grid: SensorGrid = field(default_factory=SensorGrid)
    """The cells, with the sensor's name."""
    order: tuple[int, ...] = ()
    """For each cell, row by row, the channel of the source that it is wired to, from 0; empty for 0, 1, 2 and so on."""
    unit: Unit = "count"
    """Unit of the samples."""
    full_scale: float | None = None
    """Magnitude in `unit` at which the source clips.

    It scales sources that report only fractions of full scale (audio) or counts (serial)."""
    sensitivity: float | None = None
    """Nominal output per pressure, the same for all cells, in `unit` per Pa."""

    def __post_init__(self) -> None:
        order = tuple(int(channel) for channel in self.order) or tuple(range(self.grid.count))
        if len(order) != self.grid.count or len(set(order)) != len(order) or min(order) < 0:
            raise ShapeError(
                f"order of the channels: expected {self.grid.count} different numbers from 0 on, one for each of "
                f"{self.grid.rows} x {self.grid.columns} cells, got {list(order)}"
            )
        object.__setattr__(self, "order", order)
        if self.unit not in get_args(Unit):
            raise UnitError(f"unit of the sensor: expected one of {', '.join(get_args(Unit))}, got {self.unit!r}")
        if self.full_scale is not None:
            positive(self.full_scale, "full scale", self.unit)
        if self.sensitivity is not None and not (np.isfinite(self.sensitivity) and self.sensitivity != 0):
            raise InputError(
                f"sensitivity: expected a number other than 0 {self.unit}/Pa, got {self.sensitivity:g}; leave it out "
                "if it is unknown"
            )

    def __repr__(self) -> str:
        in_order = self.order == tuple(range(self.grid.count))
        return summary(
            self,
            self.grid.spelled,
            f"{counted(self.grid.count, 'channel')} {'in order' if in_order else 'in an order of their own'}",
            f"in {self.unit}",
            "" if self.full_scale is None else f"full scale {self.full_scale:g} {self.unit}",
            "" if self.sensitivity is None else f"{self.sensitivity:g} {self.unit}/Pa",
        )

    @classmethod
    def for_channels(cls, channels: int, *, name: str = "sensor", unit: Unit = "count") -> "SensorWiring":
        """Channels in the order of the source: a square of cells 11 mm apart if the number allows one, else one row."""
        if channels < 1:
            raise ShapeError(f"channels: expected at least 1, got {channels}")
        side = isqrt(channels)
        rows, columns = (side, side) if side * side == channels else (1, channels)
        return cls(grid=SensorGrid(rows=rows, columns=columns, name=name), unit=unit)

    @property
    def channels(self) -> int:
        """Minimum number of channels of the source."""
        return max(self.order) + 1

    def with_order(self, order: Sequence[int]) -> "SensorWiring":
        """The same sensor with another order of channels."""
        return replace(self, order=tuple(order))

    def arrange(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Assign samples of the source's channels, (frame, channel), to the cells, (frame, row, column).

        The unit stays; channels without a cell are dropped. Raises ShapeError if the source has too few channels.
        """
        if samples.ndim != 2 or samples.shape[1] < self.channels:
            raise ShapeError(
                f"{self.grid.name}: expected frames of {self.channels} channels or more, got shape {samples.shape}; "
                "correct the order in the sensor file"
            )
        return samples[:, list(self.order)].reshape(-1, *self.grid.shape)
