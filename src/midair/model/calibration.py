"""How a sensor answers to pressure, channel by channel."""

import hashlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model.geometry import SensorGrid
from midair.model.measurement import Crosstalk, Linearity, Measurement
from midair.model.pictures import curve, framed
from midair.model.provenance import Provenance
from midair.model.recording import Unit
from midair.model.reprs import came_from, clipped, counted, span, told
from midair.validation import frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """Frequency response of each channel of one sensor, and its noise.

    Attributes
    ----------
    sensor : SensorGrid
        The sensor it was made with, by its name.
    frequency : ndarray, shape (bin,)
        Increasing, in Hz.
    response : ndarray of complex, shape (bin, row, column)
        Output over pressure, in `unit` per Pa.
    noise : ndarray, shape (row, column)
        One-sided noise density of the output, in `unit` per sqrt(Hz).
    unit : {"V", "count", "Pa"}
        Of the sensor's output.
    date : str
        When it was made, ISO 8601; empty when nobody wrote it down.
    provenance : Provenance
        How it was made.
    version : int
        Of this sensor's calibration: 1 for the first, one more for each that takes an older one's place.
    measurement : Measurement, optional
        How sure it is; None for one that was stated, not measured.
    crosstalk : Crosstalk, optional
        What the cells feel of each other's pressure; None when it is not known. `response` is then that of a pressure
        on the cell alone; otherwise that of an even pressure on all of them.
    linearity : Linearity, optional
        What was found at several levels.
    """

    sensor: SensorGrid
    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]
    noise: NDArray[np.float64]
    unit: Unit = "V"
    date: str = ""
    provenance: Provenance = field(default_factory=Provenance)
    version: int = 1
    measurement: Measurement | None = None
    crosstalk: Crosstalk | None = None
    linearity: Linearity | None = None

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
        return told(
            self,
            f"{counted(len(self.frequency), 'bin')} {span(self.frequency, 'Hz')}",
            self.sensor.spelled,
            f"|response| {span(np.abs(self.response), f'{self.unit}/Pa')}",
            "stated" if self.measurement is None else "measured",
            f"version {self.version} {clipped(self.date)}".rstrip(),
            came_from(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    def _repr_html_(self) -> str:
        # A response falls to nothing at 0 Hz, which no logarithmic axis has.
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

        It is a statement, not a measurement; the steps of whatever is made with it say so.
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
        """Eight letters and digits that change with sensor, unit, date, version, bins, response, noise or crosstalk."""
        # Spelled out, and for good: files tell by this number which calibration their recording was made pressure with.
        cells = ", ".join(f"{name}={getattr(self.sensor, name)!r}" for name in ("rows", "columns", "pitch", "name"))
        digest = hashlib.sha256(f"SensorGrid({cells}) {self.unit} {self.date} {self.version}".encode())
        for part in (self.frequency, self.response, self.noise):
            digest.update(part.tobytes())
        if self.crosstalk is not None:
            digest.update(self.crosstalk.matrix.tobytes())
        return digest.hexdigest()[:8]

    def uncertainty_at(self, frequency: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Standard uncertainty of the magnitude between the bins, as a part of it, shape (f, row, column).

        None when the calibration was not measured.
        """
        if self.measurement is None:
            return None
        return self._between(frequency, self.measurement.magnitude_uncertainty)

    def response_at(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """The response between the bins, by linear interpolation of real and imaginary part; held at the ends.

        Parameters
        ----------
        frequency : ndarray, shape (f,)
            In Hz.

        Returns
        -------
        ndarray of complex, shape (f, row, column)
            In `unit` per Pa.
        """
        return self._between(frequency, self.response)

    def _between(self, frequency: NDArray[np.float64], values: NDArray[Any]) -> NDArray[Any]:
        """`values` of the bins, interpolated in a straight line and held at the ends."""
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
