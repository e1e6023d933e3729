"""Frequency response and noise of a sensor, channel by channel."""

import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.geometry import SensorGrid
from midair.model.measurement import Crosstalk, Linearity, Measurement
from midair.model.provenance import Provenance
from midair.model.recording import Unit
from midair.model.reprs import clipped, counted, from_source, span, summary
from midair.model.svg_pictures import curve, framed
from midair.validation import frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """Frequency response and noise of each channel of one sensor."""

    sensor: SensorGrid
    """The calibrated sensor, identified by its name."""
    frequency: NDArray[np.float64]
    """Frequencies of the bins, increasing, shape (bin,), in Hz."""
    response: NDArray[np.complex128]
    """Complex output over pressure, shape (bin, row, column), in `unit` per Pa."""
    noise: NDArray[np.float64]
    """One-sided noise density of the output, shape (row, column), in `unit` per sqrt(Hz)."""
    unit: Unit = "V"
    """Unit of the sensor's output."""
    date: str = ""
    """Date of the calibration, ISO 8601; empty if unknown."""
    provenance: Provenance = field(default_factory=Provenance)
    version: int = 1
    """Version of this sensor's calibration: 1 for the first, one more for each that replaces an older one."""
    measurement: Measurement | None = None
    """Uncertainties; None for a calibration that was stated, not measured."""
    crosstalk: Crosstalk | None = None
    """Crosstalk between the cells; None if unknown.

    With crosstalk, `response` is that of a pressure on one cell alone; without, that of a uniform pressure on all
    cells."""
    linearity: Linearity | None = None
    """Result of measurements at several levels."""

    def __post_init__(self) -> None:
        frequency = frozen_array(self.frequency, "frequency", ("bin",))
        axes = (self.sensor.rows, self.sensor.columns)
        if frequency[0] < 0 or (np.diff(frequency) <= 0).any():
            raise InputError("frequency: expected increasing numbers from 0 Hz on; sort the bins")
        response = frozen_array(self.response, "response", (len(frequency), *axes), np.complex128)
        noise = frozen_array(self.noise, "noise", axes)
        if (noise < 0).any():
            raise InputError(f"noise: expected densities of 0 or more, got {noise.min():g}")
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "response", response)
        object.__setattr__(self, "noise", noise)
        if self.version < 1:
            raise InputError(f"version of the calibration: expected 1 or more, got {self.version}")
        self._check_parts()

    def __repr__(self) -> str:
        return summary(
            self,
            f"{counted(len(self.frequency), 'bin')} {span(self.frequency, 'Hz')}",
            self.sensor.spelled,
            f"|response| {span(np.abs(self.response), f'{self.unit}/Pa')}",
            "stated" if self.measurement is None else "measured",
            f"version {self.version} {clipped(self.date)}".rstrip(),
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    def _repr_html_(self) -> str:
        # A logarithmic axis has no place for 0 Hz.
        kept = self.frequency > 0 if (self.frequency > 0).sum() > 1 else np.ones(len(self.frequency), bool)
        size = np.abs(self.response[kept]).reshape(int(kept.sum()), -1)
        picture = curve(
            self.frequency[kept],
            np.median(size, axis=1),
            around=(size.min(axis=1), size.max(axis=1)),
            x_label="Hz",
            y_unit=f"{self.unit}/Pa",
            logarithmic=bool(kept.sum() > 1 and self.frequency[kept][0] > 0),
        )
        said = f"|response| in {self.unit}/Pa over frequency in Hz: median and range of {self.sensor.count} channels"
        return framed(self, picture, said, simulated=self.provenance.simulated)

    @classmethod
    def flat(cls, sensor: SensorGrid, *, sensitivity: float = 1.0, unit: Unit = "V") -> "Calibration":
        """A nominal calibration: the same `sensitivity` (unit per Pa) on every channel at every frequency.

        It is stated, not measured; the provenance of derived data records this.
        """
        if not (np.isfinite(sensitivity) and sensitivity != 0):
            raise InputError(f"sensitivity: expected a number other than 0 {unit}/Pa, got {sensitivity:g}")
        return cls(
            sensor=sensor,
            frequency=np.array([0.0, 1e6]),
            response=np.full((2, *sensor.shape), sensitivity, complex),
            noise=np.zeros(sensor.shape),
            unit=unit,
            provenance=Provenance(source=f"nominal: {sensitivity:g} {unit}/Pa, flat"),
        )

    @property
    def identifier(self) -> str:
        """Eight hexadecimal digits: a hash of sensor, unit, date, version, bins, response, noise and crosstalk."""
        # This format must not change: files store the identifier of the calibration that was applied to them.
        cells = ", ".join(f"{name}={getattr(self.sensor, name)!r}" for name in ("rows", "columns", "pitch", "name"))
        digest = hashlib.sha256(f"SensorGrid({cells}) {self.unit} {self.date} {self.version}".encode())
        for part in (self.frequency, self.response, self.noise):
            digest.update(part.tobytes())
        if self.crosstalk is not None:
            digest.update(self.crosstalk.matrix.tobytes())
        return digest.hexdigest()[:8]

    def uncertainty_at(self, frequency: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Relative standard uncertainty of the magnitude, interpolated, shape (f, row, column).

        None for a calibration that was not measured.
        """
        if self.measurement is None:
            return None
        return self._between(frequency, self.measurement.magnitude_uncertainty)

    def response_at(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """The response in `unit` per Pa, shape (f, row, column), at frequencies in Hz, shape (f,).

        Real and imaginary part are interpolated linearly; beyond the bins the first or the last value holds.
        """
        return self._between(frequency, self.response)

    def _between(self, frequency: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
        """`values` of the bins, interpolated linearly; constant beyond the ends."""
        where = np.clip(np.interp(frequency, self.frequency, np.arange(len(self.frequency))), 0, None)
        low = np.minimum(where.astype(int), len(self.frequency) - 2) if len(self.frequency) > 1 else where.astype(int)
        high = np.minimum(low + 1, len(self.frequency) - 1)
        part = (where - low)[:, None, None]
        return (1 - part) * values[low] + part * values[high]

    def _check_parts(self) -> None:
        bins, cells = len(self.frequency), self.sensor.count
        if self.measurement is not None and self.measurement.coherence.shape != (bins, *self.sensor.shape):
            raise ShapeError(
                f"measurement: expected shape {(bins, *self.sensor.shape)} like the response, got "
                f"{self.measurement.coherence.shape}"
            )
        if self.crosstalk is not None and len(self.crosstalk.matrix) != cells:
            raise ShapeError(f"crosstalk: expected {cells} x {cells}, got {self.crosstalk.matrix.shape}")
        if self.linearity is not None and self.linearity.gain.shape != self.sensor.shape:
            raise ShapeError(f"linearity: expected {self.sensor.shape} cells, got {self.linearity.gain.shape}")
