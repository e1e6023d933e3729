"""Samples of a sensor, its wiring and events, and frames of the pressure and of the sound that is to produce it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isqrt
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, ShapeError, UnitError
from midair.model.geometry import ControlGrid, SensorGrid
from midair.model.provenance import Provenance, counted, frames_and_duration, from_source, span, summary
from midair.model.shown import Frames
from midair.streaming import LazyFrames
from midair.validation import frozen_array, number, one_of, positive

Unit = Literal["V", "count", "Pa"]
"""Unit of a recording's samples."""

_PREFIXES = (
    *[("", "", 1.0), ("n", "nano", 1e-9), ("u", "micro", 1e-6), ("µ", "micro", 1e-6), ("μ", "micro", 1e-6)],
    *[("m", "milli", 1e-3), ("h", "hecto", 1e2), ("k", "kilo", 1e3), ("K", "kilo", 1e3), ("M", "mega", 1e6)],
)
_NAMES: Mapping[Unit, str] = MappingProxyType({"V": "volt", "Pa": "pascal"})
_SYMBOLS: dict[str, tuple[Unit, float]] = {
    short + symbol: (unit, factor)
    for short, _, factor in _PREFIXES
    for unit in _NAMES
    for symbol in (unit, unit.lower(), unit.upper())
}
_WORDS: dict[str, tuple[Unit, float]] = {
    f"{long}{name}{plural}": (unit, factor)
    for _, long, factor in _PREFIXES
    for unit, name in _NAMES.items()
    for plural in ("", "s")
}


def known_unit(text: str) -> tuple[Unit | None, float]:
    """Unit of a recording for a spelling, and the factor into it; None and 1 for unknown spellings.

    SI prefixes of symbols differ by case: mPa, MPa.
    """
    text = text.strip()
    if text.lower() in ("count", "counts", "raw", "adc", "lsb"):
        return "count", 1.0
    return _SYMBOLS.get(text) or _WORDS.get(text.lower()) or (None, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording(Frames):
    """Samples of a sensor grid."""

    samples: NDArray[np.float64]
    """Shape (frame, row, column), in `unit`."""
    rate: float
    """Frames per second, in Hz: frame i was sampled at i / rate."""
    sensor: SensorGrid = field(default_factory=SensorGrid)
    unit: Unit = "V"
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", frozen_array(self.samples, "samples", ("frame", *self.sensor.shape)))
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))
        one_of(self.unit, Unit, "unit of the samples", error=UnitError)

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
    def duration(self) -> float:
        """Number of frames divided by the rate, in s."""
        return self.frames / self.rate


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
        one_of(self.unit, Unit, "unit of the sensor", error=UnitError)
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressureFrames(Frames):
    """Calibrated pressure on the cells of a sensor; signed, since the sensor measures only changes."""

    pressure: Array
    """Shape (frame, row, column), in Pa."""
    rate: float
    """Frames per second, in Hz."""
    sensor: SensorGrid = field(default_factory=SensorGrid)
    band: tuple[float, float] | None = None
    """(low, high) of the pass band, in Hz; None if nothing was filtered."""
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pressure", frozen_array(self.pressure, "pressure", ("frame", *self.sensor.shape)))
        if self.band is not None:
            object.__setattr__(self, "band", tuple(map(float, frozen_array(self.band, "band", (2,)))))
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    def __repr__(self) -> str:
        return summary(
            self,
            frames_and_duration(self.frames, self.rate),
            self.sensor.spelled,
            span(self.pressure, "Pa"),
            "" if self.band is None else f"band {self.band[0]:g} to {self.band[1]:g} Hz",
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    def cut(self, start: float = 0.0, duration: float | None = None) -> "PressureFrames":
        """The frames from `start` on, for `duration` seconds or to the end; time begins again at 0.

        Raises InputError if no frame is left.
        """
        first, last = frame_range(start, duration, self.frames, self.rate, "cut")
        step = self.provenance.then("cut", {"start_s": first / self.rate, "duration_s": (last - first) / self.rate})
        return replace(self, pressure=self.pressure[first:last], provenance=step)


def frame_range(start: float, duration: float | None, frames: int, rate: float, name: str) -> tuple[int, int]:
    """Return the first frame of a part and the frame after its last; InputError if it has no frames."""
    begin, length = number(start, "start", "s"), np.inf if duration is None else number(duration, "duration", "s")
    first = round(begin * rate) if np.isfinite(begin) else -1
    last = frames if length == np.inf else min(frames, first + round(np.nan_to_num(length) * rate))
    if not 0 <= first < last:
        wanted = f"one that begins at {begin:g} s" if length == np.inf else f"{begin:g} to {begin + length:g} s"
        raise InputError(f"{name}: expected a part of 0 to {frames / rate:.4g} s, got {wanted}")
    return first, last


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AmplitudeFrames(Frames):
    """Peak sound pressure required at each control point."""

    amplitude: Array
    """Peak amplitude, 0 or more, shape (frame, point), in Pa."""
    rate: float
    """Frames per second, in Hz."""
    grid: ControlGrid = field(default_factory=ControlGrid)
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        amplitude = frozen_array(self.amplitude, "amplitude", ("frame", self.grid.count))
        # Lazy frames are checked when they are read.
        if not isinstance(amplitude, LazyFrames) and (amplitude < 0).any():
            raise InputError(f"amplitude: expected 0 Pa or more, got {amplitude.min():g} Pa; it is a magnitude")
        object.__setattr__(self, "amplitude", amplitude)
        object.__setattr__(self, "rate", positive(self.rate, "rate", "Hz"))

    def __repr__(self) -> str:
        return summary(
            self,
            frames_and_duration(self.frames, self.rate, self.provenance),
            f"{self.grid.rows} x {self.grid.columns} points {1e3 * self.grid.height:.4g} mm above the array",
            f"up to {self.amplitude.max():.4g} Pa",
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )
