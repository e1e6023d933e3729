"""Envelope of transducers, which differ in resonance, quality factor and strength, after a change of the drive.

Near resonance a transducer follows dq/dt = p (q - s c), with c the drive, p = -1/tau + j dw its pole and s c its steady
state (see `TransducerDynamics`). In its manufacturer's circuit, inductance L and resistance R in series, tau = 2 L / R,
and the driving force does not depend on R. So a transducer of pole p has the steady state s = p0 / p relative to a
nominal one of pole p0 and strength 1: another resonance means another amplitude and phase.
"""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Complex
from midair.errors import InputError
from midair.model import ArrayCalibration
from midair.validation import frozen_array, positive


@dataclass(frozen=True, slots=True, kw_only=True)
class TransducerDynamics:
    """Envelope of one transducer after a change of its drive, as that of a resonant circuit.

    Near resonance the Butterworth-Van Dyke circuit of the T4010A1 (39.80 kHz, Q about 23.5) responds to a change of the
    complex drive with one exponential: q(t + dt) = c + (q(t) - c) exp((-1/tau + j dw) dt), with c the drive, tau the
    time constant and dw the detuning between drive and resonance.
    """

    time_constant: float = 188e-6
    """tau in s; 2 Q / omega_0."""
    detuning: float = 2 * np.pi * 205
    """dw, resonance minus drive frequency, in rad/s."""

    def __post_init__(self) -> None:
        positive(self.time_constant, "time constant", "s")

    @property
    def pole(self) -> complex:
        """-1 / tau + j dw, in rad/s."""
        return complex(-1 / self.time_constant, self.detuning)


def envelope(
    q: Complex, rate: float, substeps: int, dynamics: TransducerDynamics, *, start: Complex | None = None
) -> Complex:
    """Output of the transducers while the drive steps from frame to frame, shape (frame * substeps, transducer).

    `q`, complex of shape (frame, transducer), is held for one frame each, at `rate` frames per second. There are
    `substeps` samples per frame, the last one at its end; the result is exact at each, for any number. `start`, shape
    (transducer,), is the envelope before the first frame; 0 if None.
    """
    if substeps < 1:
        raise InputError(f"substeps: expected 1 or more per frame, got {substeps}")
    step = 1 / (rate * substeps)
    decay = np.exp(dynamics.pole * step * np.arange(1, substeps + 1))
    out = np.empty((len(q), substeps, q.shape[1]), complex)
    now = np.zeros(q.shape[1], complex) if start is None else start
    for frame, drive in enumerate(q):
        out[frame] = drive + (now - drive) * decay[:, None]
        now = out[frame, -1]
    return out.reshape(-1, q.shape[1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transducers:
    """Dynamics and strength of each transducer of an array."""

    pole: Complex
    """-1 / time constant + j detuning in rad/s, shape (transducer,)."""
    response: Complex
    """Complex steady state at full drive, over that of the field model, shape (transducer,)."""

    def __post_init__(self) -> None:
        pole: Complex = frozen_array(self.pole, "pole of the transducers", ("transducer",), np.complex128)
        if pole.real.max() >= 0:
            raise InputError(
                f"pole of the transducers: expected a real part below 0 rad/s (a decay), got {pole.real.max():g}"
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
        """`count` transducers of the same dynamics, with the strength of the field model."""
        return cls(pole=np.full(count, (dynamics or TransducerDynamics()).pole), response=np.ones(count, complex))

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
        """`count` transducers with random differences, as in real arrays.

        `dynamics` are the mean ones, the default ones if None, and `gain` is the mean strength relative to the field
        model. The spreads are standard deviations: of the strengths and of the quality factors as a fraction of their
        means, and of the resonance frequencies in Hz. Quality factors below a fifth of the mean are clipped.
        """
        if min(gain, gain_spread, resonance_spread, quality_spread) < 0:
            raise InputError(
                "spread of the transducers: expected gain and spreads of 0 or more, got "
                f"{gain:g}, {gain_spread:g}, {resonance_spread:g} Hz and {quality_spread:g}"
            )
        rng = np.random.default_rng(seed)
        # A value below 0 would be a transducer of the opposite sign.
        strength = np.clip(gain * (1 + gain_spread * rng.standard_normal(count)), 0, None)
        resonance = resonance_spread * rng.standard_normal(count)
        quality = np.clip(1 + quality_spread * rng.standard_normal(count), 0.2, None)
        nominal = (dynamics or TransducerDynamics()).pole
        pole = nominal.real / quality + 1j * (nominal.imag + 2 * np.pi * resonance)
        return cls(pole=pole, response=strength * nominal / pole)

    @classmethod
    def measured(cls, calibration: ArrayCalibration) -> "Transducers":
        """The measured transducers; a dead one is silent."""
        return cls(pole=calibration.pole, response=calibration.response)
