"""Envelope of a transducer after a change of its drive, as that of a resonant circuit.

Near resonance the Butterworth-Van Dyke circuit of the T4010A1 (39.80 kHz, Q about 23.5) responds to a change of the
complex drive with one exponential: q(t + dt) = c + (q(t) - c) exp((-1/tau + j dw) dt), with c the drive, tau the time
constant and dw the detuning between drive and resonance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.validation import positive

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class TransducerDynamics:
    """Envelope dynamics of one transducer."""

    time_constant: float = 188e-6
    """tau in s; 2 Q / omega_0."""
    detuning: float = 2 * np.pi * 205
    """dw, resonance minus drive frequency, in rad/s."""

    def __post_init__(self) -> None:
        positive(self.time_constant, "time constant", "s")


def envelope(
    q: Complex, rate: float, substeps: int, dynamics: TransducerDynamics, *, start: Complex | None = None
) -> Complex:
    """Output of the transducers while the drive steps from frame to frame, shape (frame * substeps, transducer).

    The result is exact at every sample, for any number of substeps.

    Parameters
    ----------
    q : ndarray of complex, shape (frame, transducer)
        Drive, held for one frame each.
    rate : float
        Frames per second, in Hz.
    substeps : int
        Samples per frame; the last one is at the end of the frame.
    start : ndarray of complex, shape (transducer,), optional
        Envelope before the first frame; 0 if None.
    """
    if substeps < 1:
        raise InputError(f"substeps: expected 1 or more per frame, got {substeps}")
    step = 1 / (rate * substeps)
    decay = np.exp((-1 / dynamics.time_constant + 1j * dynamics.detuning) * step * np.arange(1, substeps + 1))
    out = np.empty((len(q), substeps, q.shape[1]), complex)
    now = np.zeros(q.shape[1], complex) if start is None else start
    for frame, drive in enumerate(q):
        out[frame] = drive + (now - drive) * decay[:, None]
        now = out[frame, -1]
    return out.reshape(-1, q.shape[1])
