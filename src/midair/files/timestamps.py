"""Convert rows with time stamps to frames at a fixed rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import RateError
from midair.streaming import blocks

FILLED = 10
"""Maximum number of interpolated frames in gaps per recorded row."""

FILLED_ANYWAY = 10_000
"""Number of interpolated frames that is always allowed: a pause of ten seconds at 1 kHz."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Uniform:
    """Frames at a fixed rate, and a report of the conversion."""

    samples: Array
    """Shape (frame, channel), at the times i / rate after the first stamp."""
    rate: float
    report: tuple[str, ...]
    """Sentences on repeated stamps, gaps and interpolation."""


def to_fixed_rate(time: Array, samples: Array, *, rate: float | None = None) -> Uniform:
    """Interpolate samples, shape (row, channel), linearly from stamped times (s) to frames at a fixed rate.

    The rate is the mean over rows outside of gaps, which exceed 1.5 times the median distance of stamps; `rate`
    replaces it if within 2 %. Rows whose stamps are on the grid already, to a thousandth of a frame, are kept.
    """
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        raise RateError(f"time stamps: expected one in every row, got none in row {row + 1}; leave that row out")
    if (np.diff(time) < 0).any():
        row = int(np.argmax(np.diff(time) < 0))
        raise RateError(f"time stamps: expected increasing values, got {time[row + 1]:g} s after {time[row]:g} s")
    keep = np.concatenate([[True], np.diff(time) > 0])
    repeats = f"{(~keep).sum()} of {len(keep)} rows have the time stamp of the row before: the first of each was kept."
    report = (*(() if keep.all() else (repeats,)), *repeated_rows(samples[keep]))
    time, samples = time[keep] - time[0], samples[keep]
    if len(time) < 2:
        raise RateError(f"time stamps: expected two that differ, got {len(time)}; give the rate and drop the stamps")
    distance = np.diff(time)
    usual = distance <= 1.5 * np.median(distance)
    rate = _rate(float(1 / distance[usual].mean()), rate)
    _check_gaps(time, usual, rate)
    place = time * rate
    if np.abs(place - np.arange(len(place))).max() < 1e-3:
        return Uniform(samples=samples, rate=rate, report=report)
    frames = np.arange(int(place[-1] + 1e-3) + 1)
    even = np.stack([np.interp(frames, place, channel) for channel in samples.T], axis=1)
    low, high = distance[usual].min() * 1e3, distance[usual].max() * 1e3
    text = f"Time stamps are {low:.4g} to {high:.4g} ms apart: interpolated linearly to {rate:.9g} Hz."
    return Uniform(samples=even, rate=rate, report=(*report, *_gaps(time, usual), text))


def _check_gaps(time: Array, usual: NDArray[np.bool_], rate: float) -> None:
    """Raise RateError if far more frames would be interpolated than recorded, as a single wrong stamp can cause."""
    distance = np.where(usual, 0, np.diff(time))
    made_up = float(distance.sum()) * rate
    most = max(FILLED * len(time), FILLED_ANYWAY)
    if not made_up <= most:
        longest = int(np.argmax(distance))
        raise RateError(
            f"time stamps: expected gaps of {most} frames at most, got {made_up:.4g} at {rate:.6g} Hz, the "
            f"longest {distance[longest]:.4g} s after {time[longest]:.4g} s; check that stamp, or cut the rows there"
        )


def _rate(measured: float, nominal: float | None) -> float:
    if nominal is None:
        return float(f"{measured:.9g}")
    if not abs(measured / nominal - 1) < 0.02:
        raise RateError(
            f"rate: expected about {measured:.6g} Hz from the time stamps, got {nominal:g} Hz; leave it out"
        )
    return nominal


def repeated_rows(samples: Array) -> tuple[str, ...]:
    """Report of rows, shape (row, channel), that repeat the previous one at a later time, if not all do."""
    repeats, before = 0, samples[:0]
    for block in blocks(samples):
        rows = np.concatenate([before, block])
        repeats, before = repeats + int((np.diff(rows, axis=0) == 0).all(axis=1).sum()), block[-1:]
    if not repeats or repeats == len(samples) - 1:
        return ()
    of = len(samples)
    return (f"{repeats} of {of} rows repeat every channel of the row before, at a later time: they were kept.",)


def _gaps(time: Array, usual: NDArray[np.bool_]) -> tuple[str, ...]:
    if usual.all():
        return ()
    distance = np.where(usual, 0, np.diff(time))
    longest = int(np.argmax(distance))
    return (
        f"{int((~usual).sum())} gaps in the time stamps, the longest {distance[longest] * 1e3:.4g} ms "
        f"after {time[longest]:.4g} s: filled by straight lines.",
    )
