"""What was measured of each transducer of an array: how strong, how late, and how fast it follows its drive."""

import hashlib
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, MismatchError
from midair.model.geometry import TransducerArray
from midair.model.provenance import Provenance
from midair.model.reprs import came_from, counted, told
from midair.validation import frozen_array

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCalibration:
    """The transducers of one array as they are; every uncertainty is a standard one (k = 1).

    Attributes
    ----------
    array : TransducerArray
        The array, as its model says it is.
    response : ndarray of complex, shape (transducer,)
        What each one radiates when it has settled under full drive, over what the model says; 0 for a dead one. The
        phase that all share cannot be heard: it is 0 on average.
    pole : ndarray of complex, shape (transducer,)
        -1 / time constant + j (resonance less drive), in rad/s.
    strength_uncertainty : ndarray, shape (transducer,)
        Of the magnitude of the response, from one transducer to the next.
    phase_uncertainty : ndarray, shape (transducer,)
        Of its phase, in rad.
    resonance_uncertainty : ndarray, shape (transducer,)
        In Hz.
    quality_uncertainty : ndarray, shape (transducer,)
        Of the quality factor, as a part of it.
    dead : ndarray of bool, shape (transducer,)
        That were not heard; their pole is what is usual.
    level_uncertainty : float
        What the magnitudes share, as a part of them: half that of the sensor's level, since pressure goes with the
        square.
    date : str
        When it was made, ISO 8601; empty when nobody wrote it down.
    provenance : Provenance
        How it was made.
    """

    array: TransducerArray
    response: Complex
    pole: Complex
    strength_uncertainty: Array
    phase_uncertainty: Array
    resonance_uncertainty: Array
    quality_uncertainty: Array
    dead: NDArray[np.bool_]
    level_uncertainty: float = 0.0
    date: str = ""
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
        object.__setattr__(self, "dead", frozen_array(self.dead, "dead transducers", shape, np.bool_))
        if self.pole.real.max() >= 0:
            raise InputError(f"pole: expected a real part below 0 rad/s, got {self.pole.real.max():g}")
        if not 0 <= self.level_uncertainty < np.inf:
            raise InputError(f"level uncertainty: expected 0 or more, got {self.level_uncertainty:g}")
        object.__setattr__(self, "array", self.array.nominal)

    def __repr__(self) -> str:
        return told(
            self,
            counted(self.array.count, "transducer"),
            f"{int(self.dead.sum())} dead" if self.dead.any() else "none dead",
            f"strength {self.strength[~self.dead].mean():.3g} ± {self.strength[~self.dead].std():.2g}",
            came_from(self.provenance.source),
            simulated=self.provenance.simulated,
        )

    @property
    def strength(self) -> Array:
        """Magnitude of each response, shape (transducer,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Array:
        """Of each response, shape (transducer,), in rad."""
        return np.angle(self.response)

    @property
    def resonance(self) -> Array:
        """Resonance of each, shape (transducer,), in Hz."""
        return np.asarray(self.array.frequency + self.pole.imag / (2 * np.pi), np.float64)

    @property
    def quality(self) -> Array:
        """Quality factor of each, shape (transducer,): pi times resonance times time constant."""
        return np.asarray(-np.pi * self.resonance / self.pole.real, np.float64)

    @property
    def identifier(self) -> str:
        """Of what was measured, in eight digits."""
        digest = hashlib.sha256(self.response.tobytes() + self.pole.tobytes())
        return digest.hexdigest()[:8]

    def applied(self, array: TransducerArray) -> TransducerArray:
        """The same array with its transducers as they were measured, to be solved for.

        Raises
        ------
        MismatchError
            If it is another array.
        """
        if not array.same_as(self.array):
            raise MismatchError(
                f"array calibration: expected {self.array.name} with {self.array.count} transducers where they were "
                f"measured, got {array.name} with {array.count}; measure this array, or solve for the other"
            )
        return replace(array, response=self.response, pole=self.pole)
