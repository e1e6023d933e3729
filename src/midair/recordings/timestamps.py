"""The time base of all readers: stamped rows become frames at a fixed rate, and rows that were lost become gaps.

A clock is often coarser than the samples: a file has one stamp for a packet, or stamps of few digits. Rows are even
where a straight line meets the stamps within the resolution of the clock, or where the file states a fixed rate; they
then keep their values. Elsewhere the stamps are taken as exact, and rows are interpolated between them.
"""

import re
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import RateError

FILLED = 0.05
"""Largest share of frames that may be missing."""

USED = 0.9
"""Smallest share of rows that must be used."""

BACK = 0.2
"""Stamps of a stream with jitter may run back by less than this, in s."""

_WORD = r"((?:milli|micro|nano|[mnuµμ])?s(?:ecs?|econds?)?)"
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_CLOCK = re.compile(
    r"(?:(?:elapsed|relative|system|unix|local|logging|sample|device|host)[\s_]?)?(?:time(?:[\s_]?stamp)?|ts?|epoch|zeit|"
    rf"elapsed|x[-_]axis|x[-_]value)(?:[\s_]*[\s_\[(/]\s*{_WORD}\s*[\])]?)?|{_WORD}_elapsed|(millis|micros|nanos)",
    re.IGNORECASE,
)
_DATES = (978e6, 4.1e9)  # 2001 to 2099, in s since 1970
_GUESSED = (20.0, 200e3)  # rates in Hz of a clock whose unit is not stated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Uniform:
    """Frames at a fixed rate, and a report of the conversion."""

    samples: Array
    """Shape (frame, channel), at the times i / rate after the first stamp; NaN in frames whose rows are missing."""
    rate: float
    missing: int
    """Number of frames whose rows are missing."""
    report: tuple[str, ...]
    """Sentences on rate, used rows, missing frames, repeated stamps, gaps and interpolation."""


def is_clock(name: str) -> bool:
    """True if a column of this name holds time stamps."""
    return _CLOCK.fullmatch(name) is not None


def seconds(stamps: Array, name: str, *, rate: float | None) -> tuple[Array, tuple[str, ...]]:
    """Stamps of a column in s after the first, and a report if `name` does not state their unit.

    The unit then follows from a stated `rate` (Hz), or from the size of a date. Numbers with decimals are in s; other
    whole numbers raise RateError.
    """
    stated = _CLOCK.fullmatch(name)
    word = next((each.lower() for each in (stated.groups() if stated else ()) if each), "")
    unit = word and {"": "s", "m": "ms", "milli": "ms", "n": "ns", "nano": "ns"}.get(word.partition("s")[0], "us")
    span = float(np.ptp(stamps)) if len(stamps) else 0.0
    since = stamps - stamps[:1]
    if unit or not np.isfinite(span) or span == 0:
        return since * _SECONDS.get(unit, 1.0), ()
    measured = {unit: (len(stamps) - 1) / span / _SECONDS[unit] for unit in _SECONDS}
    dates = [unit for unit in measured if _DATES[0] < np.abs(stamps).max() * _SECONDS[unit] < _DATES[1]]
    whole = bool((stamps == np.round(stamps)).all())
    fits = [unit for unit in measured if rate is not None and 0.5 < measured[unit] / rate < 2]
    if rate is not None and whole and not fits:
        tick = (len(stamps) - 1) / span / rate
        return since * tick, (f"Column {name!r} does not state its unit: steps of {tick:.3g} s fit {rate:g} Hz.",)
    unit = (fits or dates or ["" if whole else "s"])[0]
    if rate is None and not (unit and _GUESSED[0] <= measured[unit] <= _GUESSED[1]):
        could = ", ".join(f"{each:.4g} Hz in {unit}" for unit, each in measured.items())
        raise RateError(
            f"time stamps: expected a unit in the name of column {name!r}, such as 'time [ms]', or the rate, got "
            f"neither ({could})",
            parameters={"rate": "rate=1000 (Hz)"},
        )
    return since * _SECONDS[unit], (f"Column {name!r} does not state its unit: {unit} was assumed.",)


def to_fixed_rate(time: Array, samples: Array, *, rate: float | None = None, nominal: float | None = None) -> Uniform:
    """Place samples, shape (row, channel), with stamps (s) on frames at a fixed rate; missing rows become NaN.

    The rate is measured; a stated `rate` replaces it if within 2 %. `nominal` is the fixed rate (Hz) of a stream whose
    stamps have jitter: rows are then even between losses. Raises RateError if stamps run back, contradict a stated
    rate, or if more than 10 % of the rows are copies or more than 5 % of the frames are missing.
    """
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        raise RateError(f"time stamps: expected one in every row, got none in row {row + 1}; leave that row out")
    back = np.diff(time) < (0 if nominal is None else -BACK)
    if back.any():
        row = int(np.argmax(back))
        raise RateError(f"time stamps: expected increasing values, got {time[row + 1]:g} s after {time[row]:g} s")
    rows, keep = len(time), ~_copies(time, samples)
    time, samples = time[keep] - time[:1], samples[keep]
    copies = f"{(~keep).sum()} of {rows} rows repeat stamp and numbers of the row before: they were left out."
    report = () if keep.all() else (copies,)
    if len(time) < USED * rows:
        raise RateError(f"time stamps: expected at least {USED:.0%} of the rows to differ; {copies} Remove the copies")
    starts = np.flatnonzero(np.concatenate([[True], np.diff(time) != 0]))
    shared = len(time) - len(starts)
    if len(starts) < (3 if shared else 2):
        if rate is None:
            raise RateError(
                f"time stamps: expected at least {3 if shared else 2} that differ, got {len(starts)}; "
                "give the rate and drop the stamps"
            )
        return _even(np.arange(len(time)), samples, rate, rows, (*report, "The time stamps do not differ enough."))
    if shared:
        text = f"{shared} of {rows} rows have the time stamp of the row before: they were spread evenly."
        report = (*report, text)
    report = (*report, *repeated_rows(samples))
    if rate is not None and (
        nominal is not None or shared > len(time) / 2 or abs(len(time) / time[-1] / rate - 1) < 0.02
    ):
        nominal = rate
    numbers, period, off, tolerance = _numbers(time, starts, nominal)
    if nominal is not None:
        measured, losses = _rate(1 / period, nominal, tolerance), np.count_nonzero(np.diff(numbers) > 1)
        if off > period and losses * off > FILLED * len(time) * period:
            raise RateError(
                f"time stamps: expected losses that can be placed, got {losses} under stamps that deviate by "
                f"{off * 1e3:.3g} ms; record it again with fewer losses"
            )
        if abs(measured / nominal - 1) > 1e-3:
            report = (*report, f"The stated rate is {nominal:g} Hz, the time stamps give {measured:.6g} Hz.")
        return _even(numbers, samples, rate or measured, rows, report)
    if off > _resolution(time, starts, period):
        if shared > len(time) / 2:
            raise RateError(
                f"time stamps: expected packets at even times, got times that deviate by {off * 1e3:.4g} ms; state the "
                "rate if the rows are even"
            )
        return _interpolated(_spread(time, starts, period), samples, rate, rows, report)
    measured = _rate(1 / period, rate)
    return _even(numbers, samples, rate or measured, rows, report)


def typical_period(stamps: Array) -> float:
    """Typical time between frames, in s: the median slope of the stamps, which few gaps and jitter hardly change."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(stamps) != 0]))
    return _slope(stamps[starts], starts)


def _slope(stamps: Array, number: NDArray[np.int_]) -> float:
    by = min(max(1, len(stamps) // 10), 300)
    return float(np.median((stamps[by:] - stamps[:-by]) / (number[by:] - number[:-by])))


def _copies(time: Array, samples: Array) -> NDArray[np.bool_]:
    """Rows that repeat stamp and numbers of the row before, if all rows that repeat a stamp do and few others."""
    same = np.concatenate([[False], np.diff(time) == 0])
    equal = np.concatenate([[False], (samples[1:] == samples[:-1]).all(axis=1)])
    written_twice = equal[same].all() and equal[~same].mean() < 0.5
    return same if written_twice else np.zeros(len(time), bool)


def _numbers(
    time: Array, starts: NDArray[np.int_], nominal: float | None
) -> tuple[NDArray[np.int_], float, float, float]:
    """Frame number of each row if rows are even between losses.

    Returns also the period and the range of deviations, in s, and the tolerance of a stated rate.
    """
    # A row that shares its stamp may be anywhere in it; the first of a stamp begins it, except in the first stamp.
    shared = len(starts) < len(time)
    points = starts[1:] if shared else starts
    stamps = time[points]
    period, width, least, tolerance = _slope(stamps, points), len(points) // 10, 0.5, 0.02
    if nominal is not None:
        steps = np.diff(stamps) / np.diff(points)
        if (np.abs(steps * nominal - 1) < 0.05).mean() > 0.5:
            period, width = float(np.median(steps)), 0
        else:  # so much jitter that losses may be missed: the rate must then agree
            edge = 2 * float(np.quantile(np.diff(stamps), 0.9)) / float(np.ptp(stamps))
            period, width, least, tolerance = 1 / nominal, len(points) // 20, 1.5, min(0.02, max(2e-3, edge))
    width, least = min(max(8, width), 300), max(least, 1.5 * shared)
    lost = _lost(stamps, points, width, period=period, least=least)
    if nominal is None:
        lost = _lost(stamps, points, width, period=np.polyfit(points + lost, stamps, 1)[0], least=least)
    period, start = np.polyfit(points + lost, stamps, 1)
    off = stamps - start - period * (points + lost)
    numbers = np.arange(len(time)) + np.repeat(lost, np.diff([0, *points[1:], len(time)]))
    return numbers, float(period), float(np.ptp(off)), tolerance


def _lost(stamps: Array, points: NDArray[np.int_], width: int, *, period: float, least: float) -> NDArray[np.int_]:
    """Rows lost before each stamp: those by which it and the next ones are later than before, by `least` or more."""
    late = stamps - points * period
    earliest = np.diff(late[: len(late) // width * width].reshape(-1, width).min(axis=1))
    spread = float(np.median(np.abs(earliest - np.median(earliest)))) if len(earliest) > 1 else 0.0
    limit = max(least * period, 6 * spread)
    lost, last = np.zeros(len(points), np.int_), 0
    for i in (np.flatnonzero(np.diff(late[: 1 - min(8, len(late) - 1) or None]) > limit) + 1).tolist():
        step = late[i : i + width].min() - late[max(last, i - width) : i].min()
        if step > limit:
            lost[i], last = min(round(step / period), 2**40), i
    return np.cumsum(lost)


def _resolution(time: Array, starts: NDArray[np.int_], period: float) -> float:
    """Range of deviations from even times, in s, that the resolution of the clock explains."""
    distance, shared = np.diff(time[starts]), len(time) - len(starts)
    if shared > len(time) / 2:
        return max(2 * period, 0.5 * float(np.median(distance)))
    if shared:
        return 2 * period
    steps = np.unique(np.round(distance[distance < 2.5 * period] / (1e-3 * period))) * 1e-3 * period
    return max(2e-3 * period, 1.1 * min(float(np.diff(steps).min()), period) if len(steps) > 1 else 0.0)


def _spread(time: Array, starts: NDArray[np.int_], period: float) -> Array:
    """Stamps in which rows that share one are evenly spread up to the next, or at most by one period a row."""
    count = np.diff([*starts, len(time)])
    step = np.minimum(np.diff([*time[starts], np.inf]) / count, 1.5 * period)
    return time + (np.arange(len(time)) - np.repeat(starts, count)) * np.repeat(step, count)


def _even(numbers: NDArray[np.int_], samples: Array, rate: float, rows: int, report: tuple[str, ...]) -> Uniform:
    frames = int(numbers[-1]) + 1
    gaps = np.diff(numbers) - 1
    said = _said(rate, len(samples), rows, frames, gaps.astype(float), numbers / rate)
    placed = np.full((frames, samples.shape[1]), np.nan)
    placed[numbers] = samples
    return Uniform(samples=placed, rate=rate, missing=frames - len(samples), report=(*report, *said))


def _interpolated(time: Array, samples: Array, rate: float | None, rows: int, report: tuple[str, ...]) -> Uniform:
    distance = np.diff(time)
    usual = distance <= 1.5 * np.median(distance)
    measured = _rate(float(1 / distance[usual].mean()), rate)
    rate = rate or measured
    place = time * rate
    gaps = np.where(usual, 0.0, np.round(distance * rate) - 1)
    said = _said(rate, len(samples), rows, int(min(place[-1] + 1e-3, 2**60)) + 1, gaps, time)
    frames = np.arange(int(place[-1] + 1e-3) + 1)
    even = np.stack([_spline(frames, place, channel) for channel in samples.T], axis=1)
    before = np.clip(np.searchsorted(place, frames, side="right") - 1, 0, len(usual) - 1)
    missing = ~usual[before] & (frames - place[before] > 0.5) & (place[before + 1] - frames > 0.5)
    even[missing] = np.nan
    low, high = distance[usual].min() * 1e3, distance[usual].max() * 1e3
    text = f"Time stamps are {low:.4g} to {high:.4g} ms apart: interpolated by cubic splines to {rate:.9g} Hz."
    return Uniform(samples=even, rate=rate, missing=int(missing.sum()), report=(*report, *said, text))


def _spline(frames: NDArray[np.int_], place: Array, channel: Array) -> Array:
    """Interpolated numbers of a channel; NaN beside numbers that are not finite."""
    known = np.isfinite(channel)
    if known.sum() < 2:
        return np.full(len(frames), np.nan)
    even = scipy.interpolate.CubicSpline(place[known], channel[known])(frames)
    return np.where(np.interp(frames, place, ~known) > 0, np.nan, even)


def _said(rate: float, used: int, rows: int, frames: int, gaps: Array, time: Array) -> tuple[str, ...]:
    """Sentences on rate, used rows and missing frames; RateError if more of them are missing than `FILLED`."""
    missing, longest = float(gaps.sum()), int(np.argmax(gaps))
    where = f"the longest {gaps[longest] / rate * 1e3:.4g} ms after {time[longest]:.4g} s"
    if missing > FILLED * frames:
        share = min(missing / frames, 1)
        raise RateError(
            f"time stamps: expected at most {FILLED:.0%} of the frames to be missing, got {share:.1%} "
            f"({missing:.6g} at {rate:.6g} Hz), {where}; check the stamps, or cut the rows there"
        )
    shares = f"{100 * used / rows:.3g} % of {rows} rows used, {100 * missing / frames:.3g} % of {frames} frames filled"
    summary = f"Rate {rate:.9g} Hz: {shares}."
    lost = (f"{np.count_nonzero(gaps)} gaps in the time stamps, {where}.",)
    return (summary, *(lost if missing else ()))


def _rate(measured: float, stated: float | None, tolerance: float = 0.02) -> float:
    """The measured rate; RateError if it contradicts the stated one."""
    if stated is not None and not abs(measured / stated - 1) < tolerance:
        raise RateError(f"rate: expected about {measured:.6g} Hz from the time stamps, got {stated:g} Hz; correct one")
    return float(f"{measured:.9g}")


def repeated_rows(samples: Array) -> tuple[str, ...]:
    """Report of rows, shape (row, channel), that repeat the previous one at a later time, if not all do."""
    repeats = int((np.diff(samples, axis=0) == 0).all(axis=1).sum())
    if not repeats or repeats == len(samples) - 1:
        return ()
    of = len(samples)
    return (f"{repeats} of {of} rows repeat every channel of the row before, at a later time: they were kept.",)
