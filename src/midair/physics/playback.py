"""Radiation pressure moment by moment while an array plays frames: p = G q at every moment, and its square."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.dsp import resample
from midair.errors import RateError, ShapeError
from midair.model import Acoustics, Drive, Medium
from midair.physics.chain import PlaybackChain, Precision, Waves, radiate
from midair.physics.dynamics import TransducerDynamics
from midair.physics.radiation import radiation_pressure

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


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
    """Radiation pressure at points, or on cells, at every moment while an array plays a drive.

    Parameters
    ----------
    drive : Drive
        What the array is told; it is silent before.
    G : ndarray of complex, shape (point, transducer)
        Transfer matrix from `transfer_matrix`, in Pa.
    chain : PlaybackChain, optional
        What is simulated; 8-bit phases that step, and transducers that follow at once, if None.
    rate : float
        Moments per second, in Hz: a whole multiple of the drive's rate.
    acoustics : Acoustics, optional
        Its medium tells the radiation pressure; the one that the drive was solved for if None.
    weights : ndarray, shape (cell, point), optional
        Cells that average over the points, from `cell_weights`.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    ndarray, shape (frame * rate / drive.rate, point) or (..., cell)
        In Pa. Step i is at the end of the i-th stretch of 1 / rate; with an ideal hold at its beginning.

    Raises
    ------
    RateError
        If the rate is not a whole multiple of the drive's.
    ShapeError
        If G, the weights or the chain's transducers are for another number of transducers or points.
    """
    chain, acoustics = chain or PlaybackChain(), acoustics or drive.acoustics
    steps = steps_a_frame(drive.rate, rate)
    _check(drive, G, chain, weights)
    spread = Spread.of(G, acoustics.medium, weights, chain.precision)
    if chain.hold == "ideal":
        # A band-limited curve between pressures can dip below 0, and sound cannot pull.
        return np.maximum(resample(_still(drive, chain, spread), drive.rate, rate), 0.0)
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
    """What playing frames does to a small change of pressure: hold, ramps and envelope, with their delays.

    sinc(f / R) sinc(f T) exp(-j pi f (1 / R + T)) H(f), H = (h(f) + h*(-f)) / 2 with h = p / (p - 2 pi j f) and
    p = -1 / tau + j dw. Without detuning H is 1 / (1 + 2 pi j f tau). It acts on the amplitude of the sound where its
    phase stays as it is; and on pressure, which goes with the square, for changes that are small against it.

    Parameters
    ----------
    frequency : ndarray, any shape
        In Hz.
    rate : float
        R, frames per second, in Hz.
    dynamics : TransducerDynamics, optional
        Dynamics of the transducers; the usual ones if None.
    ramp : float
        T, over how long a silencer spreads each step, in s.

    Returns
    -------
    ndarray of complex, same shape
    """
    dynamics, f = dynamics or TransducerDynamics(), np.asarray(frequency, float)
    pole = complex(-1 / dynamics.time_constant, dynamics.detuning)
    follows = (pole / (pole - 2j * np.pi * f) + np.conj(pole / (pole + 2j * np.pi * f))) / 2
    held = np.sinc(f / rate) * np.sinc(f * ramp) * np.exp(-1j * np.pi * f * (1 / rate + ramp))
    return np.asarray(held * follows, np.complex128)


def steps_a_frame(drive_rate: float, rate: float) -> int:
    """How many moments at `rate` one frame has.

    Raises
    ------
    RateError
        If not a whole number from 1 on.
    """
    steps = rate / drive_rate
    if steps < 1 or abs(steps - round(steps)) > 1e-6:
        raise RateError(
            f"drive: expected a rate that {rate:g} Hz is a whole multiple of, got {drive_rate:g} Hz; "
            "solve it at 1000 Hz"
        )
    return round(steps)


def check_frame_rate(rate: float, frequency: float = 40e3) -> int:
    """How many periods of the ultrasound one frame lasts: an array changes its frames on whole ones.

    Raises
    ------
    RateError
        If `rate` is not `frequency` over a whole number; the message names rates that are.
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
    """The way from what transducers radiate to pressure at points, or on cells.

    Attributes
    ----------
    G : ndarray of complex, shape (transducer, point)
        In the precision of the field.
    factor : float
        Radiation pressure of 1 Pa of sound, in Pa.
    weights : ndarray or None, shape (point, cell)
        Weights of the cells.
    """

    G: Waves
    factor: float
    weights: NDArray[Any] | None

    @classmethod
    def of(cls, G: Complex, medium: Medium, weights: Array | None, precision: Precision) -> "Spread":
        """Make it for a transfer matrix of (point, transducer), and weights of (cell, point) if there are cells."""
        real, exact = (np.float32, np.complex64) if precision == "single" else (np.float64, np.complex128)
        return cls(
            # Laid out for the product that each moment of the drive needs.
            G=np.ascontiguousarray(G.T, exact),
            factor=float(radiation_pressure(np.ones(1), medium)[0]),
            weights=None if weights is None else np.ascontiguousarray(weights.T, real),
        )

    @property
    def width(self) -> int:
        """Number of points, or of cells where there are weights."""
        return self.G.shape[1] if self.weights is None else self.weights.shape[1]

    def pressure(self, q: Waves) -> Array:
        """Radiation pressure of drives (step, transducer), shape (step, point) or (step, cell), in Pa."""
        field = q.astype(self.G.dtype, copy=False) @ self.G
        power = field.real**2 + field.imag**2
        return self.factor * np.asarray(power if self.weights is None else power @ self.weights, np.float64)


def _still(drive: Drive, chain: PlaybackChain, spread: Spread) -> Array:
    """Pressure of each frame as if it lasted for ever, shape (frame, point or cell)."""
    return np.concatenate([spread.pressure(q) for q, _ in radiate(drive, chain, 1)])


def _check(drive: Drive, G: Complex, chain: PlaybackChain, weights: Array | None) -> None:
    count = drive.array.count
    if G.ndim != 2 or G.shape[1] != count:
        raise ShapeError(f"G: expected (point, {count}) for this drive's array, got {G.shape}")
    if chain.transducers is not None and chain.transducers.count != count:
        raise ShapeError(f"transducers: expected {count} for this drive's array, got {chain.transducers.count}")
    if weights is not None and (weights.ndim != 2 or weights.shape[1] != len(G)):
        raise ShapeError(f"weights: expected (cell, {len(G)}) for these points, got {weights.shape}")
