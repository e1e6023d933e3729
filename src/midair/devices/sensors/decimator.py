"""Streaming decimation: linear phase, bounded memory, no aliases."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from midair.errors import RateError
from midair.validation import positive

Array = NDArray[np.float64]

CENTRE = 64
"""Output frames from the filter's first coefficient to its centre."""

RATIO_MAX = 1000
"""Largest denominator of the ratio of the rates that counts as exact."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyphase:
    """A linear-phase low-pass filter in polyphase form: `length` input frames become `count` output frames.

    `pieces`, shape (piece, count, length), holds the coefficients of consecutive runs of `length` input frames. `delay`
    is the time from an output frame to the last input frame that it needs, in s.
    """

    pieces: Array
    delay: float

    @property
    def count(self) -> int:
        """Output frames per run."""
        return self.pieces.shape[1]

    @property
    def length(self) -> int:
        """Input frames per run."""
        return self.pieces.shape[2]

    @classmethod
    def between(cls, rate: float, new_rate: float) -> "Polyphase":
        """The filter from `rate` down to `new_rate`, both in Hz; raises RateError unless their ratio is a simple
        fraction below 1.

        Windowed sinc with a Kaiser window, beta = 8 (Oppenheim and Schafer, Discrete-Time Signal Processing, 7.6), as
        in `midair.dsp.resample`: flat to 0.1 % up to 94 % of half the new rate (470 of 500 Hz), 0.5 at half the new
        rate, -80 dB from 106 % of it on. The delay is 64 frames of the new rate.
        """
        from scipy.signal import firwin

        ratio = Fraction(positive(new_rate, "rate", "Hz") / positive(rate, "rate", "Hz")).limit_denominator(RATIO_MAX)
        count, length = ratio.numerator, ratio.denominator
        if ratio >= 1 or ratio == 0 or abs(count * rate - length * new_rate) > 1e-6 * new_rate * length:
            raise RateError(
                f"rate: expected one below {rate:g} Hz whose ratio to it is a fraction up to {RATIO_MAX}, "
                f"got {new_rate:g} Hz; leave the rate out to use the source's own"
            )
        runs = -(-2 * CENTRE // count)
        half = CENTRE * length
        # Times `count`: at the interpolated rate only one frame in `count` is not zero.
        fir = np.asarray(firwin(2 * half + 1, 1 / length, window=("kaiser", 8.0)), np.float64) * count
        return cls(pieces=_cut(fir, count, length, runs + 2), delay=CENTRE / new_rate)


def _cut(fir: Array, count: int, length: int, runs: int) -> Array:
    """Coefficients by run of input frames.

    In steps of the interpolated rate, input frame i lies at count * i and output frame j at (CENTRE + j) * length; the
    coefficient follows from their distance.
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
    """Filters a stream of `channels` channels to a lower rate, block by block."""

    def __init__(self, filter: Polyphase, channels: int) -> None:
        self._filter = filter
        self._held = np.zeros((0, channels))

    def push(self, samples: NDArray[np.floating]) -> Array:
        """Add input frames, shape (frame, channel), and return the output frames that are now complete, perhaps none.

        Output frame k lies at input frame (64 + k) * rate / new_rate; earlier ones would need frames before the first
        input.
        """
        pieces, length = self._filter.pieces, self._filter.length
        held = np.concatenate([self._held, samples])
        runs = len(held) // length - len(pieces) + 1
        if runs < 1:
            self._held = held
            return np.zeros((0, held.shape[1]))
        whole = held[: (runs + len(pieces) - 1) * length].reshape(-1, length, held.shape[1])
        out = sum(np.matmul(piece, whole[at : at + runs]) for at, piece in enumerate(pieces))
        # A view would keep all previous input in memory.
        self._held = held[runs * length :].copy()
        return np.asarray(out, np.float64).reshape(-1, held.shape[1])
