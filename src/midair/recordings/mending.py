"""Fill short gaps in recordings: values that are NaN or infinite, replaced by interpolation.

Two methods: "line" interpolates linearly and loses any vibration; "spectrum" minimises the prediction error of an
autoregressive model of the neighbourhood, with model and values estimated in turn (A. Janssen, R. Veldhuis & L. Vries,
IEEE Trans. ASSP 34(2), 1986).
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError, NonFiniteError
from midair.model import Event
from midair.validation import positive

GapFill = Literal["spectrum", "line"]
"""Autoregressive interpolation, or a straight line."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mending:
    """Settings for filling gaps."""

    longest: float = 20e-3
    """Longest gap that may be filled, in s; longer ones raise an error."""
    fill: GapFill = "spectrum"

    def __post_init__(self) -> None:
        positive(self.longest, "longest gap", "s")
        if self.fill not in get_args(GapFill):
            raise InputError(f"mend: expected one of {', '.join(get_args(GapFill))}, got {self.fill!r}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mended:
    """Samples without gaps, and the positions of the gaps that were filled."""

    samples: Array
    """Finite, shape (frame, channel)."""
    journal: tuple[Event, ...]
    """One event of kind "mended" for each gap of each channel, sorted by frame."""


def mend(samples: Array, rate: float, mending: Mending) -> Mended:
    """Fill the gaps (NaN or infinite) of all channels in `samples` (frame, channel); all other values stay equal.

    A gap at either end of the recording takes the nearest value; `rate` is in Hz. Raises NonFiniteError if a gap is
    longer than `mending` allows.
    """
    filled = np.array(samples, np.float64)
    journal: list[Event] = []
    for channel, wave in enumerate(filled.T):
        gaps = _gaps(wave)
        for first, last in gaps:
            _check(channel, first, last - first, rate, mending)
            journal.append(Event(kind="mended", frame=first, frames=last - first, channel=channel))
        _fill(wave, gaps, mending.fill)
    return Mended(samples=filled, journal=tuple(sorted(journal, key=lambda event: (event.frame, event.channel))))


def _gaps(wave: Array) -> list[tuple[int, int]]:
    """First frame of each gap, and the first frame after it."""
    missing = np.concatenate([[False], ~np.isfinite(wave), [False]])
    ends = np.flatnonzero(missing[1:] != missing[:-1])
    return [(int(first), int(last)) for first, last in ends.reshape(-1, 2)]


def _check(channel: int, first: int, frames: int, rate: float, mending: Mending) -> None:
    # Half a frame of tolerance, so that rounding does not matter: 20 ms at 1 kHz are 20 frames.
    if frames > mending.longest * rate + 0.5:
        raise NonFiniteError(
            f"mend: expected gaps of {mending.longest * 1e3:g} ms at most, got {frames} frames "
            f"({frames / rate * 1e3:.4g} ms) from {first / rate:.4g} s on in channel {channel}; allow longer ones "
            "(--longest) or leave that channel out (--channels)"
        )


def _fill(wave: Array, gaps: list[tuple[int, int]], fill: GapFill) -> None:
    """Fill the gaps of one channel in place."""
    if not gaps:
        return
    missing = ~np.isfinite(wave)
    known = np.flatnonzero(~missing)
    wave[missing] = np.interp(np.flatnonzero(missing), known, wave[known])
    if fill == "line":
        return
    for first, last in gaps:
        if first > 0 and last < len(wave):
            _predict(wave, missing, first, last)


def _predict(wave: Array, missing: NDArray[np.bool_], first: int, last: int) -> None:
    """Fill one gap in place by autoregressive interpolation; other gaps near it stay linear."""
    # Janssen's rule for the order, and a neighbourhood of up to ten orders on either side.
    order = min(3 * (last - first) + 2, 64)
    begin, end = max(0, first - 10 * order), min(len(wave), last + 10 * order)
    if int((~missing[begin:end]).sum()) < 4 * order:
        return
    around = wave[begin:end]
    mean = float(around[~missing[begin:end]].mean())
    x = around - mean
    gap = np.arange(first - begin, last - begin)
    inside = slice(first - begin, last - begin)
    for _ in range(5):
        errors = _prediction_errors(x, order)
        rest = np.delete(errors, gap, axis=1) @ np.delete(x, gap)
        # A small ridge, so that a silent neighbourhood is solvable.
        gram = errors[:, inside].T @ errors[:, inside] + 1e-12 * np.eye(last - first)
        x[inside] = np.linalg.solve(gram, -errors[:, inside].T @ rest)
    wave[first:last] = x[inside] + mean


def _prediction_errors(x: Array, order: int) -> Array:
    """Matrix of the errors of predicting each value of `x` from the `order` values before it."""
    from scipy.linalg import convolution_matrix, solve_toeplitz

    n = len(x)
    correlation = np.correlate(x, x, "full")[n - 1 : n + order] / n
    # 1e-7 of white noise, because pure tones leave the model undetermined.
    correlation[0] = correlation[0] * (1 + 1e-7) + np.finfo(float).tiny
    model = np.concatenate([[1.0], -solve_toeplitz(correlation[:order], correlation[1:])])
    return np.asarray(convolution_matrix(model, n, mode="valid"), np.float64)
