"""Transducers that are not all alike: each has its own resonance, quality and strength.

One transducer near its resonance is dq/dt = p (q - s c), with c the drive, p = -1/tau + j dw its pole and s c what it
settles at (see `dynamics`). The circuit that its maker prints has one inductance L and a resistance R in series: tau =
2 L / R, and what drives it does not depend on R. So a transducer of pole p under a drive that a nominal one (pole p0)
follows with strength 1 settles at s = p0 / p: another resonance means another amplitude and another phase.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import ArrayCalibration
from midair.physics.dynamics import TransducerDynamics
from midair.validation import frozen_array

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transducers:
    """How each transducer of an array follows its drive.

    Attributes
    ----------
    pole : ndarray of complex, shape (transducer,)
        -1 / time constant + j detuning, in rad/s.
    response : ndarray of complex, shape (transducer,)
        What each settles at under full drive, over what the model of the field assumes.
    """

    pole: Complex
    response: Complex

    def __post_init__(self) -> None:
        pole: Complex = frozen_array(self.pole, "pole of the transducers", ("transducer",), np.complex128)
        if pole.real.max() >= 0:
            raise InputError(
                f"pole of the transducers: expected a real part below 0 rad/s, got {pole.real.max():g}; it would grow"
            )
        response = frozen_array(self.response, "response of the transducers", (len(pole),), np.complex128)
        object.__setattr__(self, "pole", pole)
        object.__setattr__(self, "response", response)

    @property
    def count(self) -> int:
        """Number of transducers."""
        return len(self.pole)

    @classmethod
    def alike(cls, count: int, dynamics: TransducerDynamics | None = None) -> "Transducers":
        """`count` transducers of the same dynamics, as strong as the model assumes."""
        return cls(pole=np.full(count, _pole(dynamics or TransducerDynamics())), response=np.ones(count, complex))

    @classmethod
    def varied(
        cls,
        count: int,
        dynamics: TransducerDynamics | None = None,
        *,
        seed: int,
        gain: float = 1.0,
        gain_spread: float = 0.0,
        resonance_spread: float = 0.0,
        quality_spread: float = 0.0,
    ) -> "Transducers":
        """`count` transducers that differ, as those of real arrays do.

        Parameters
        ----------
        count : int
            Number of transducers.
        dynamics : TransducerDynamics, optional
            Their mean; the usual one if None.
        seed : int
            The same seed gives the same transducers.
        gain : float
            Mean strength over the model's.
        gain_spread : float
            Standard deviation of the strengths, as a part of the mean.
        resonance_spread : float
            Standard deviation of the resonances, in Hz.
        quality_spread : float
            Standard deviation of the quality factors, as a part of the mean; kept above a fifth of it.
        """
        if min(gain, gain_spread, resonance_spread, quality_spread) < 0:
            raise InputError(
                "spread of the transducers: expected gain and spreads of 0 or more, got "
                f"{gain:g}, {gain_spread:g}, {resonance_spread:g} Hz and {quality_spread:g}"
            )
        rng = np.random.default_rng(seed)
        # A draw below 0 would be a transducer of the opposite sign.
        strength = np.clip(gain * (1 + gain_spread * rng.standard_normal(count)), 0, None)
        resonance = resonance_spread * rng.standard_normal(count)
        quality = np.clip(1 + quality_spread * rng.standard_normal(count), 0.2, None)
        nominal = _pole(dynamics or TransducerDynamics())
        pole = nominal.real / quality + 1j * (nominal.imag + 2 * np.pi * resonance)
        return cls(pole=pole, response=strength * nominal / pole)

    @classmethod
    def measured(cls, calibration: ArrayCalibration) -> "Transducers":
        """Those that were measured, a dead one silent."""
        return cls(pole=calibration.pole, response=calibration.response)


def _pole(dynamics: TransducerDynamics) -> complex:
    return complex(-1 / dynamics.time_constant, dynamics.detuning)
