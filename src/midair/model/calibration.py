"""How a sensor answers to pressure, channel by channel."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model.arrays import frozen_array
from midair.model.geometry import SensorGrid
from midair.model.provenance import Provenance
from midair.model.recording import Unit


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
    """

    sensor: SensorGrid
    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]
    noise: NDArray[np.float64]
    unit: Unit = "V"
    date: str = ""
    provenance: Provenance = field(default_factory=Provenance)

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
        where = np.clip(np.interp(frequency, self.frequency, np.arange(len(self.frequency))), 0, None)
        low = np.minimum(where.astype(int), len(self.frequency) - 2) if len(self.frequency) > 1 else where.astype(int)
        high = np.minimum(low + 1, len(self.frequency) - 1)
        part = (where - low)[:, None, None]
        return (1 - part) * self.response[low] + part * self.response[high]
