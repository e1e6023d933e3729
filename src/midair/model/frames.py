"""Sequences of frames: pressure on the skin, and the sound amplitude that is to produce it."""

from dataclasses import dataclass, field, replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model.geometry import ControlGrid, SensorGrid
from midair.model.provenance import Provenance
from midair.model.reprs import frames_and_duration, from_source, span, summary
from midair.streaming import LazyFrames
from midair.validation import frozen_array, positive


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressureFrames:
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
        axes = ("frame", self.sensor.rows, self.sensor.columns)
        object.__setattr__(self, "pressure", frozen_array(self.pressure, "pressure", axes))
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

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.pressure)

    @property
    def time(self) -> Array:
        """Time of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate

    def cut(self, start: float = 0.0, duration: float | None = None) -> "PressureFrames":
        """The frames from `start` on, for `duration` seconds or to the end; time begins again at 0.

        Raises InputError if no frame is left.
        """
        first, whole = round(start * self.rate), self.frames / self.rate
        last = self.frames if duration is None else min(self.frames, first + round(duration * self.rate))
        if not 0 <= first < last:
            wanted = f"{start:g} s on" if duration is None else f"{start:g} to {start + duration:g} s"
            raise InputError(f"cut: expected a part of 0 to {whole:g} s, got {wanted}")
        step = self.provenance.then("cut", {"start_s": first / self.rate, "duration_s": (last - first) / self.rate})
        return replace(self, pressure=self.pressure[first:last], provenance=step)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AmplitudeFrames:
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
            frames_and_duration(self.frames, self.rate),
            f"{self.grid.rows} x {self.grid.columns} points {1e3 * self.grid.height:.4g} mm above the array",
            f"up to {self.amplitude.max():.4g} Pa",
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.amplitude)

    @property
    def time(self) -> Array:
        """Time of each frame, shape (frame,), in s."""
        return np.arange(self.frames) / self.rate
