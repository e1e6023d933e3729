"""Radiation pressure at every moment while an array plays frames: the square of p = G q."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.dsp import resample
from midair.errors import RateError, ShapeError
from midair.model import Acoustics, Drive, Medium
from midair.physics.playback_chain import PlaybackChain, Precision, Waves, radiate
from midair.physics.radiation import radiation_pressure
from midair.physics.transducers import TransducerDynamics


def simulate(
    drive: Drive,
    G: Complex,
    *,
    chain: PlaybackChain | None = None,
    rate: float,
    acoustics: Acoustics | None = None,
    weights: Array | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Array:
    """Radiation pressure in Pa at points, or on cells, at every moment while an array plays a drive.

    Raises RateError if the rate is not a whole multiple of the drive's; ShapeError if G, the weights or the chain's
    transducers do not match the drive's array or the points.

    Parameters
    ----------
    drive : Drive
        The array is silent before it.
    G : ndarray of complex, shape (point, transducer)
        From `transfer_matrix`, in Pa.
    chain : PlaybackChain, optional
        Simulated effects; if None, 8-bit phases that are held, and ideal transducers.
    acoustics : Acoustics, optional
        Its medium determines the radiation pressure; if None, that of the drive.
    weights : ndarray, shape (cell, point), optional
        Cells that average over the points, from `cell_weights`.
    progress : callable, optional
        Called with (frames done, frames in total).

    Returns
    -------
    ndarray, shape (frame * rate / drive.rate, point) or (..., cell)
        Step i is at the end of the i-th interval of 1 / rate; with an ideal hold at its beginning.
    """
    chain, acoustics = chain or PlaybackChain(), acoustics or drive.acoustics
    steps = steps_per_frame(drive.rate, rate)
    _check(drive, G, chain, weights)
    spread = Spread.of(G, acoustics.medium, weights, chain.precision)
    if chain.hold == "ideal":
        # Band-limited interpolation can give negative values, which radiation pressure cannot have.
        still = np.concatenate([spread.pressure(q) for q, _ in radiate(drive, chain, 1)])
        return np.maximum(resample(still, drive.rate, rate), 0.0)
    out = np.empty((drive.frames * steps, spread.width))
    done = 0
    for q, _ in radiate(drive, chain, steps):
        out[done : done + len(q)] = spread.pressure(q)
        done += len(q)
        if progress is not None:
            progress(done // steps, drive.frames)
    return out


def playback_response(
    frequency: Array, rate: float, *, dynamics: TransducerDynamics | None = None, ramp: float = 0.0
) -> Complex:
    """Transfer function of playback for a small change of pressure: hold, ramps and envelope, with their delays.

    sinc(f / R) sinc(f T) exp(-j pi f (1 / R + T)) H(f), H = (h(f) + h*(-f)) / 2 with h = p / (p - 2 pi j f) and p = -1
    / tau + j dw. Without detuning H is 1 / (1 + 2 pi j f tau). It applies to the amplitude of sound of constant phase;
    and to pressure, which is quadratic in amplitude, for small relative changes.

    f is `frequency` and R the `rate` of frames, both in Hz; T is `ramp`, the time over which a silencer spreads each
    step, in s. The `dynamics` are the default ones if None.
    """
    dynamics, f = dynamics or TransducerDynamics(), np.asarray(frequency, float)
    pole = dynamics.pole
    follows = (pole / (pole - 2j * np.pi * f) + np.conj(pole / (pole + 2j * np.pi * f))) / 2
    held = np.sinc(f / rate) * np.sinc(f * ramp) * np.exp(-1j * np.pi * f * (1 / rate + ramp))
    return np.asarray(held * follows, np.complex128)


def steps_per_frame(drive_rate: float, rate: float) -> int:
    """Number of moments at `rate` per frame. Raises RateError if it is not a whole number, 1 or more."""
    steps = rate / drive_rate
    if steps < 1 or abs(steps - round(steps)) > 1e-6:
        raise RateError(
            f"drive: expected a frame rate of which {rate:g} Hz is a whole multiple, got {drive_rate:g} Hz; "
            "solve it at 1000 Hz"
        )
    return round(steps)


def check_frame_rate(rate: float, frequency: float = 40e3) -> int:
    """Periods of the ultrasound per frame: an array can change frames only after whole periods.

    Raises RateError if `rate` is not `frequency` over a whole number; the message names the nearest valid rates.
    """
    periods = frequency / rate
    if periods >= 1 and abs(periods - round(periods)) <= 1e-6 * periods:
        return round(periods)
    near = sorted({frequency / n for n in (max(1, int(periods)), int(periods) + 1)})
    raise RateError(
        f"frame rate: expected {frequency:g} Hz over a whole number, got {rate:g} Hz; "
        f"choose {' or '.join(f'{fits:.6g}' for fits in near)} Hz"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spread:
    """Linear map from drives to the radiation pressure at points, or on cells."""

    G: Waves
    """Transposed transfer matrix, shape (transducer, point), in the precision of the field."""
    factor: float
    """Radiation pressure of 1 Pa of sound, in Pa."""
    weights: NDArray[Any] | None
    """Weights of the cells, shape (point, cell)."""

    @classmethod
    def of(cls, G: Complex, medium: Medium, weights: Array | None, precision: Precision) -> "Spread":
        """Make it from a transfer matrix (point, transducer), and weights (cell, point) if there are cells."""
        real, exact = (np.float32, np.complex64) if precision == "single" else (np.float64, np.complex128)
        return cls(
            G=np.ascontiguousarray(G.T, exact),
            factor=float(radiation_pressure(np.ones(1), medium)[0]),
            weights=None if weights is None else np.ascontiguousarray(weights.T, real),
        )

    @property
    def width(self) -> int:
        """Number of points, or of cells if there are weights."""
        return self.G.shape[1] if self.weights is None else self.weights.shape[1]

    def pressure(self, q: Waves) -> Array:
        """Radiation pressure of drives (step, transducer), shape (step, point) or (step, cell), in Pa."""
        field = q.astype(self.G.dtype, copy=False) @ self.G
        power = field.real**2 + field.imag**2
        return self.factor * np.asarray(power if self.weights is None else power @ self.weights, np.float64)


def _check(drive: Drive, G: Complex, chain: PlaybackChain, weights: Array | None) -> None:
    count = drive.array.count
    if G.ndim != 2 or G.shape[1] != count:
        raise ShapeError(f"G: expected (point, {count}) for this drive's array, got {G.shape}")
    if chain.transducers is not None and chain.transducers.count != count:
        raise ShapeError(f"transducers: expected {count} for this drive's array, got {chain.transducers.count}")
    if weights is not None and (weights.ndim != 2 or weights.shape[1] != len(G)):
        raise ShapeError(f"weights: expected (cell, {len(G)}) for these points, got {weights.shape}")
