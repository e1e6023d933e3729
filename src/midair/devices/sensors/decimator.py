"""From the rate of a converter to the rate of frames, piece by piece: linear phase, bounded memory, no aliases."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from midair.errors import RateError
from midair.validation import positive

Array = NDArray[np.float64]

CENTRE = 64
"""Frames of the new rate from the filter's first coefficient to its middle."""

RATIO_MAX = 1000
"""Largest denominator of new rate over rate that is taken as exact."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyphase:
    """A linear-phase low-pass filter between two rates, cut into the pieces that streaming needs.

    `length` frames in become `count` frames out. A frame out lies at the centre of the filter, `delay` after the first
    frame in that it needs, and is known `delay` after it.

    Attributes
    ----------
    pieces : ndarray, shape (piece, count, length)
        Coefficients by which each of `piece` consecutive runs of `length` frames enters `count` frames.
    delay : float
        Time from a frame out to the last frame in that it needs, in s.
    """

    pieces: Array
    delay: float

    @property
    def count(self) -> int:
        """Frames out of a run."""
        return self.pieces.shape[1]

    @property
    def length(self) -> int:
        """Frames in a run."""
        return self.pieces.shape[2]

    @classmethod
    def between(cls, rate: float, new_rate: float) -> "Polyphase":
        """The filter from `rate` down to `new_rate`, both in Hz.

        Windowed sinc under a Kaiser window with beta = 8 (Oppenheim and Schafer, Discrete-Time Signal Processing, 7.6),
        the same that `midair.dsp.resample` uses: flat to 0.1 % up to 94 % of half the new rate (470 of 500 Hz), halved
        there, 80 dB down from 106 % of it on. The delay is 64 frames of the new rate.

        Raises
        ------
        RateError
            If the new rate is the higher one, or their ratio is no simple fraction.
        """
        from scipy.signal import firwin

        ratio = Fraction(positive(new_rate, "rate", "Hz") / positive(rate, "rate", "Hz")).limit_denominator(RATIO_MAX)
        count, length = ratio.numerator, ratio.denominator
        if ratio >= 1 or ratio == 0 or abs(count * rate - length * new_rate) > 1e-6 * new_rate * length:
            raise RateError(
                f"rate: expected one below {rate:g} Hz whose ratio to it is a fraction up to {RATIO_MAX}, "
                f"got {new_rate:g} Hz; leave the rate out to take the source's own"
            )
        runs = -(-2 * CENTRE // count)
        half = CENTRE * length
        # Times `count`: at the interpolated rate only one frame in so many is not zero.
        fir = np.asarray(firwin(2 * half + 1, 1 / length, window=("kaiser", 8.0)), np.float64) * count
        return cls(pieces=_cut(fir, count, length, runs + 2), delay=CENTRE / new_rate)


def _cut(fir: Array, count: int, length: int, runs: int) -> Array:
    """Coefficients by run of frames in.

    In steps of the interpolated rate, frame i in lies at count * i and frame j out at (CENTRE + j) * length: the
    coefficient is that of their distance.
    """
    half = len(fir) // 2
    inside = np.arange(runs * length)
    out = np.arange(count)
    distance = count * inside[None, :] - (half + length * out[:, None])
    weights = np.where(np.abs(distance) <= half, fir[np.clip(distance + half, 0, 2 * half)], 0.0)
    pieces = weights.reshape(count, runs, length).transpose(1, 0, 2)
    last = int(np.flatnonzero(np.abs(pieces).max(axis=(1, 2)))[-1])
    return np.ascontiguousarray(pieces[: last + 1])


class Decimator:
    """Filters a stream from one rate to a lower one as its pieces come.

    Parameters
    ----------
    filter : Polyphase
        The filter between the two rates.
    channels : int
        In a frame.
    """

    def __init__(self, filter: Polyphase, channels: int) -> None:
        self._filter = filter
        self._held = np.zeros((0, channels))

    def push(self, samples: NDArray[np.floating]) -> Array:
        """Frames out that can be known now; the first one is known once the filter is full.

        Frame k out lies at frame (64 + k) * rate / new_rate of those that were pushed: what comes before is never given
        because it would need frames that were not.

        Parameters
        ----------
        samples : ndarray, shape (frame, channel)
            Those that follow the last ones pushed.

        Returns
        -------
        ndarray, shape (frame, channel)
            Perhaps none.
        """
        pieces, length = self._filter.pieces, self._filter.length
        held = np.concatenate([self._held, samples])
        runs = len(held) // length - len(pieces) + 1
        if runs < 1:
            self._held = held
            return np.zeros((0, held.shape[1]))
        whole = held[: (runs + len(pieces) - 1) * length].reshape(-1, length, held.shape[1])
        out = sum(np.matmul(piece, whole[at : at + runs]) for at, piece in enumerate(pieces))
        # A view would keep everything that was ever pushed in memory.
        self._held = held[runs * length :].copy()
        return np.asarray(out, np.float64).reshape(-1, held.shape[1])
