"""Measured response, resonance and quality factor of each transducer of an array."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, MismatchError
from midair.model.geometry import TransducerArray
from midair.model.provenance import Provenance
from midair.model.reprs import counted, from_source, summary
from midair.validation import frozen_array

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
            name = f"{name}_uncertainty"
            values = frozen_array(getattr(self, name), name, shape)
            if values.min() < 0:
                raise InputError(f"{name}: expected 0 or more, got {values.min():g}")
            object.__setattr__(self, name, values)
        units = len(np.unique(self.array.unit))
        for name, wide in (("pose", (units, 7)), ("pose_covariance", (7 * units, 7 * units))):
            given = getattr(self, name)
            values = frozen_array(given if given.size else np.zeros(wide), f"{name} of the units", wide)
            object.__setattr__(self, name, values)
        object.__setattr__(self, "dead", frozen_array(self.dead, "dead transducers", shape, np.bool_))
        if self.pole.real.max() >= 0:
            raise InputError(f"pole: expected a real part below 0 rad/s, got {self.pole.real.max():g}")
        if not 0 <= self.level_uncertainty < np.inf:
            raise InputError(f"level uncertainty: expected 0 or more, got {self.level_uncertainty:g}")
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
