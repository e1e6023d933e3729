"""From the times at which rows were taken to frames at multiples of 1/rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import RateError
from midair.lazy_frames import blocks

Array = NDArray[np.float64]

FILLED = 10
"""Frames that straight lines may fill in gaps, for each that was recorded."""

FILLED_ANYWAY = 10_000
"""Frames that they may fill in any recording: a pause of ten seconds between two strokes at 1 kHz."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Uniform:
    """Frames at multiples of 1/rate, and what it took to get them.

    Attributes
    ----------
    samples : ndarray, shape (frame, channel)
        At the times i / rate after the first stamp.
    rate : float
        In Hz.
    report : tuple of str
        Repeated stamps, gaps, interpolation.
    """

    samples: Array
    rate: float
    report: tuple[str, ...]


def uniform(time: Array, samples: Array, *, rate: float | None = None) -> Uniform:
    """Samples at stamped times as frames at a fixed rate, by straight lines between neighbours.

    The rate is that of the rows outside of gaps, a gap being more than 1.5 times the median distance of two stamps.
    Rows whose stamps lie on the grid already, to a thousandth of a frame, are kept as they are.

    Parameters
    ----------
    time : ndarray, shape (row,)
        Not decreasing, in s.
    samples : ndarray, shape (row, channel)
        Any unit.
    rate : float, optional
        Nominal frames per second, in Hz, to use instead of the measured rate; within 2 % of it.

    Returns
    -------
    Uniform
        From the first stamp to the last.

    Raises
    ------
    RateError
        If there are fewer than two stamps, or one is missing, or they go back, or do not fit `rate`, or gaps are longer
        than all else.
    """
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        raise RateError(f"time stamps: expected one in every row, got none in row {row + 1}; leave that row out")
    if (np.diff(time) < 0).any():
        row = int(np.argmax(np.diff(time) < 0))
        raise RateError(f"time stamps: expected them to grow, got {time[row + 1]:g} s after {time[row]:g} s")
    keep = np.concatenate([[True], np.diff(time) > 0])
    report = (*_repeats(keep), *held(samples[keep]))
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
    return Uniform(samples=even, rate=rate, report=(*report, *_gaps(time, usual), _interpolated(distance[usual], rate)))


def _check_gaps(time: Array, usual: NDArray[np.bool_], rate: float) -> None:
    """Raise if straight lines would have to fill far more frames than were recorded.

    One stamp that is wrong would else fill the memory and the disk.
    """
    distance = np.where(usual, 0, np.diff(time))
    made_up = float(distance.sum()) * rate
    most = max(FILLED * len(time), FILLED_ANYWAY)
    if not made_up <= most:
        longest = int(np.argmax(distance))
        raise RateError(
            f"time stamps: expected gaps that {most} frames fill, got {made_up:.4g} at {rate:.6g} Hz, the "
            f"longest {distance[longest]:.4g} s after {time[longest]:.4g} s; is that stamp right? cut the rows there"
        )


def _rate(measured: float, nominal: float | None) -> float:
    if nominal is None:
        return float(f"{measured:.9g}")
    if not abs(measured / nominal - 1) < 0.02:
        raise RateError(
            f"rate: expected about {measured:.6g} Hz, as the time stamps say, got {nominal:g} Hz; leave it out"
        )
    return nominal


def _repeats(keep: NDArray[np.bool_]) -> tuple[str, ...]:
    repeats = int((~keep).sum())
    if not repeats:
        return ()
    return (f"{repeats} of {len(keep)} rows have the time stamp of the row before: the first of each was kept.",)


def held(samples: Array) -> tuple[str, ...]:
    """A sentence when rows, shape (row, channel), repeat the one before although time went on and some do not."""
    repeats, before = 0, samples[:0]
    for block in blocks(samples):
        rows = np.concatenate([before, block])
        repeats, before = repeats + int((np.diff(rows, axis=0) == 0).all(axis=1).sum()), block[-1:]
    if not repeats or repeats == len(samples) - 1:
        return ()
    told = f"{repeats} of {len(samples)} rows"
    return (f"{told} repeat every channel of the row before, at a later time: they were kept.",)


def _gaps(time: Array, usual: NDArray[np.bool_]) -> tuple[str, ...]:
    if usual.all():
        return ()
    distance = np.where(usual, 0, np.diff(time))
    longest = int(np.argmax(distance))
    return (
        f"{int((~usual).sum())} gaps in the time stamps, the longest {distance[longest] * 1e3:.4g} ms "
        f"after {time[longest]:.4g} s: filled by straight lines.",
    )


def _interpolated(distance: Array, rate: float) -> str:
    low, high = distance.min() * 1e3, distance.max() * 1e3
    return f"Time stamps are {low:.4g} to {high:.4g} ms apart: interpolated linearly to {rate:.9g} Hz."
