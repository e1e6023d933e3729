"""Frequency response and noise of a sensor, with uncertainty, crosstalk and linearity, and response of transducers.

Every uncertainty is a standard uncertainty (k = 1), as in the Guide to the expression of uncertainty in measurement
(GUM, JCGM 100:2008); twice its value covers about 95 %. Those from few readings are widened by Student's t.
"""

import hashlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, MismatchError, ShapeError
from midair.model.geometry import SensorGrid, TransducerArray
from midair.model.provenance import Brief, Provenance, clipped, counted, from_source, span, summary
from midair.model.recording import Unit
from midair.validation import frozen_array, number, within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Measurement(Brief):
    """Uncertainties of a calibration, bin by bin and channel by channel."""

    coherence: Array
    """Share of the output that the reference explains, 0 to 1, shape (bin, row, column)."""
    magnitude_uncertainty: Array
    """Relative uncertainty of the response's magnitude, including that of the reference, shape (bin, row, column)."""
    phase_uncertainty: Array
    """Uncertainty of the response's phase, shape (bin, row, column), in rad."""
    noise_density: Array
    """One-sided noise density of the output, shape (bin, row, column), in the calibration's unit per sqrt(Hz)."""
    noise_uncertainty: Array
    """Relative uncertainty of the calibration's `noise`, shape (row, column)."""
    delay: Array
    """Delay of each channel relative to the reference in the upper half of the bins, shape (row, column), in s."""
    delay_uncertainty: Array
    """Shape (row, column), in s."""
    reference_uncertainty: float = 0.0
    """Part of the relative magnitude uncertainty that all bins and channels share."""
    reference: str = ""
    """Name of the reference sensor or source."""
    method: str = ""
    """Description of the method."""
    takes: int = 1
    """Number of recordings that were used."""

    def __post_init__(self) -> None:
        bins = frozen_array(self.coherence, "coherence", ("bin", "row", "column"))
        object.__setattr__(self, "coherence", bins)
        for name in ("magnitude_uncertainty", "phase_uncertainty", "noise_density"):
            _freeze(self, name, bins.shape, least=0.0)
        _freeze(self, "delay", bins.shape[1:])
        for name in ("noise_uncertainty", "delay_uncertainty"):
            _freeze(self, name, bins.shape[1:], least=0.0)
        if bins.min() < -1e-9 or bins.max() > 1 + 1e-9:
            raise InputError(f"coherence: expected 0 to 1, got {bins.min():g} to {bins.max():g}")
        within(self.reference_uncertainty, "reference uncertainty", 0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Crosstalk(Brief):
    """Response of each cell to a pressure on another cell."""

    matrix: Array
    """Shape (channel, channel): output of cell i, as pressure, over the pressure on cell k alone; 1 on the diagonal."""
    uncertainty: Array
    """Uncertainty of each element, including its change over the band, shape (channel, channel)."""

    def __post_init__(self) -> None:
        matrix = frozen_array(self.matrix, "crosstalk", ("channel", "channel"))
        if matrix.shape[0] != matrix.shape[1] or np.abs(np.diag(matrix) - 1).max() > 1e-9:
            raise ShapeError(f"crosstalk: expected a square matrix with 1 on its diagonal, got shape {matrix.shape}")
        object.__setattr__(self, "matrix", matrix)
        _freeze(self, "uncertainty", matrix.shape, least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Linearity(Brief):
    """Output over pressure at five or more levels: a straight line with an intercept, and its curvature."""

    pressure: Array
    """Rms pressure, shape (level, row, column), in Pa."""
    output: Array
    """Rms of the part of the output that follows the pressure, divided by the response, shape (level, row, column), in
    Pa."""
    gain: Array
    """Slope of the line, shape (row, column); 1 if the response was measured at these levels."""
    gain_uncertainty: Array
    intercept: Array
    """Shape (row, column), in Pa."""
    intercept_uncertainty: Array
    curvature: Array
    """Relative change of the slope from the lowest to the highest level, by a fitted parabola; negative for saturation.
    """
    curvature_uncertainty: Array

    def __post_init__(self) -> None:
        pressure = frozen_array(self.pressure, "pressure of the levels", ("level", "row", "column"))
        object.__setattr__(self, "pressure", pressure)
        _freeze(self, "output", pressure.shape)
        for name in ("gain", "intercept", "curvature"):
            _freeze(self, name, pressure.shape[1:])
            _freeze(self, f"{name}_uncertainty", pressure.shape[1:], least=0.0)

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self.pressure)


def _freeze(owner: Any, name: str, shape: tuple[int, ...], *, least: float = -np.inf) -> None:
    """Replace an attribute of a frozen dataclass by its checked, read-only copy."""
    spelled = name.replace("_", " ")
    values = frozen_array(getattr(owner, name), spelled, shape)
    if values.min() < least:
        raise InputError(f"{spelled}: expected {least:g} or more, got {values.min():g}")
    object.__setattr__(owner, name, values)


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
        for name, values in (("frequency", frequency), ("response", response), ("noise", noise)):
            object.__setattr__(self, name, values)
        within(self.version, "version of the calibration", 1)
        bins, cells = len(frequency), self.sensor.count
        if self.measurement is not None and self.measurement.coherence.shape != (bins, *axes):
            raise ShapeError(
                f"measurement: expected shape {(bins, *axes)} like the response, got {self.measurement.coherence.shape}"
            )
        if self.crosstalk is not None and len(self.crosstalk.matrix) != cells:
            raise ShapeError(f"crosstalk: expected {cells} x {cells}, got {self.crosstalk.matrix.shape}")
        if self.linearity is not None and self.linearity.gain.shape != axes:
            raise ShapeError(f"linearity: expected {axes} cells, got {self.linearity.gain.shape}")

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

    @classmethod
    def flat(cls, sensor: SensorGrid, *, sensitivity: float = 1.0, unit: Unit = "V") -> "Calibration":
        """A nominal calibration: the same `sensitivity` (unit per Pa) on every channel at every frequency.

        It is stated, not measured; the provenance of derived data records this.
        """
        if not (np.isfinite(number(sensitivity, "sensitivity", f"{unit}/Pa")) and sensitivity != 0):
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
        """Relative standard uncertainty of the magnitude, interpolated, (f, row, column); None if not measured."""
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


POSE_AIMS = np.array([*[1e-4] * 3, *np.radians([0.1] * 3), 50e-9])
"""Accuracy to which the position in m, rotation in rad and time offset in s of a unit should be known."""

_POSE_NAMES = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z", "time offset")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCalibration:
    """Measured properties of the transducers of one array; every uncertainty is a standard uncertainty (k = 1)."""

    array: TransducerArray
    """The nominal array, without the measured response."""
    response: Complex
    """Complex, shape (transducer,): steady sound pressure at full drive divided by the nominal one; 0 for a dead
    transducer.

    The common phase cannot be measured: the mean phase is 0."""
    pole: Complex
    """Complex, shape (transducer,): -1 / time constant + j (resonance - drive frequency), in rad/s."""
    strength_uncertainty: Array
    """Uncertainty of the response's magnitude that differs between transducers, shape (transducer,)."""
    phase_uncertainty: Array
    """Uncertainty of the response's phase, shape (transducer,), in rad."""
    resonance_uncertainty: Array
    """Shape (transducer,), in Hz."""
    quality_uncertainty: Array
    """Relative uncertainty of the quality factor, shape (transducer,)."""
    dead: NDArray[np.bool_]
    """Transducers without a measurable output, shape (transducer,); their pole is a typical one."""
    pose: Array = field(default_factory=lambda: np.zeros((0, 7)))
    """Difference of each unit from its nominal place, shape (unit, 7): x, y, z in m, rotation about x, y, z in rad,
    time offset in s; without what all units share. The response contains its effect at the sensor. Zeros if not
    measured."""
    pose_covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Covariance of all numbers of `pose`, shape (7 unit, 7 unit); zeros if not measured."""
    reflection: complex = 0.0
    """Reflection factor of the array's face for what a palm sends back; 0 if not measured."""
    reflection_uncertainty: float = 0.0
    """Uncertainty of its real and imaginary part, with the phase at the height that was found for the sensor."""
    level_uncertainty: float = 0.0
    """Relative uncertainty that all magnitudes share: half that of the sensor's level, since radiation pressure is
    proportional to the square of the sound pressure."""
    date: str = ""
    """Date of the measurement, ISO 8601; empty if unknown."""
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        shape = (self.array.count,)
        for name in ("response", "pole"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, shape, np.complex128))
        for name in ("strength", "phase", "resonance", "quality"):
            _freeze(self, f"{name}_uncertainty", shape, least=0.0)
        units = len(np.unique(self.array.unit))
        for name, wide in (("pose", (units, 7)), ("pose_covariance", (7 * units, 7 * units))):
            given = getattr(self, name)
            values = frozen_array(given if given.size else np.zeros(wide), f"{name} of the units", wide)
            object.__setattr__(self, name, values)
        object.__setattr__(self, "dead", frozen_array(self.dead, "dead transducers", shape, np.bool_))
        if self.pole.real.max() >= 0:
            raise InputError(f"pole: expected a real part below 0 rad/s, got {self.pole.real.max():g}")
        within(self.level_uncertainty, "level uncertainty", 0)
        within(self.reflection_uncertainty, "reflection uncertainty", 0)
        object.__setattr__(self, "array", self.array.nominal)

    def __repr__(self) -> str:
        return summary(
            self,
            counted(self.array.count, "transducer"),
            f"{int(self.dead.sum())} dead" if self.dead.any() else "none dead",
            f"strength {self.strength[~self.dead].mean():.3g} ± {self.strength[~self.dead].std():.2g}",
            from_source(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def strength(self) -> Array:
        """Magnitude of each response, shape (transducer,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Array:
        """Phase of each response, shape (transducer,), in rad."""
        return np.angle(self.response)

    @property
    def resonance(self) -> Array:
        """Resonance frequency of each transducer, shape (transducer,), in Hz."""
        return np.asarray(self.array.frequency + self.pole.imag / (2 * np.pi), np.float64)

    @property
    def quality(self) -> Array:
        """Quality factor of each transducer, shape (transducer,): pi times resonance times time constant."""
        return np.asarray(-np.pi * self.resonance / self.pole.real, np.float64)

    @property
    def pose_uncertainty(self) -> Array:
        """Standard uncertainty of each number of `pose`, shape (unit, 7)."""
        return np.sqrt(np.clip(np.diag(self.pose_covariance), 0, None)).reshape(self.pose.shape)

    def inseparable(self) -> dict[str, float]:
        """Numbers of the units that the measurement cannot tell apart, each with its uncertainty over its aim.

        The singular values of the Jacobian, divided by the noise and with `POSE_AIMS` as units, are 1 / square root of
        the eigenvalues of the covariance. Along a direction with an eigenvalue above 1, numbers with more than a
        tenth of its largest component change together without a visible effect.
        """
        aims = np.tile(POSE_AIMS, len(self.pose))
        values, directions = np.linalg.eigh(self.pose_covariance / np.outer(aims, aims))
        found: dict[str, float] = {}
        for value, direction in zip(values, directions.T, strict=True):
            if value > 1:
                size = np.abs(direction).reshape(-1, 7).max(axis=0)
                names = [_POSE_NAMES[each] for each in np.flatnonzero(size > 0.1 * size.max())]
                found[" and ".join(names)] = max(found.get(" and ".join(names), 0.0), float(np.sqrt(value)))
        return found

    @property
    def identifier(self) -> str:
        """Eight hexadecimal digits: a hash of the response and the poles."""
        return self.applied(self.array).calibration_id

    def applied(self, array: TransducerArray) -> TransducerArray:
        """The same array with the measured response of its transducers, for use in a solver.

        Raises MismatchError if the transducers of `array` are at other positions.
        """
        if not array.same_as(self.array):
            raise MismatchError(
                f"array calibration: expected {self.array.name} with {self.array.count} transducers where they were "
                f"measured, got {array.name} with {array.count}; measure this array, or solve for the other"
            )
        return replace(array, response=self.response, pole=self.pole)
