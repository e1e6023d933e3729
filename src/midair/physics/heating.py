"""Heat of a drive: mean level of the array's units, and an estimate of how much the palm warms."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, Drive
from midair.physics.propagation import transfer_matrix
from midair.streaming import blocks

MINUTE = 60.0
"""Time over which the level of a unit is averaged, and longest time for which the palm keeps heat, in s."""

PUBLISHED_RISE, PUBLISHED_TIME = 5.4, 5.0
"""Warming of a palm under a strong still focus in K, and its time in s (arXiv 2411.05108, abstract)."""

STRONG_FOCUS = 2.5e5
"""Intensity of that focus in W/m2: an assumption of midair, since the abstract states none.

10 kPa rms, the linear field of two by two AUTD3 units at full drive, 0.2 m above them."""

BIN = 0.1
"""Time over which levels and intensities are averaged first, in s."""
_FRAMES, _FEWEST = 4_000, 8
"""Frames whose field is computed: all of a drive up to the first number, and at least the second in each bin."""


def unit_levels(drive: Drive, *, every: int = 1) -> Array:
    """Mean level of the transducers of each unit over `every` frames, or the rest, shape (part, unit), 0 to 1."""
    unit = drive.array.unit
    shares = (unit[:, None] == np.unique(unit)) / np.bincount(unit)[np.unique(unit)]
    means: list[Array] = []
    for part in blocks(drive.level, every * max(1, 4096 // every)):
        starts = np.arange(0, len(part), every)
        counts = np.minimum(every, len(part) - starts)
        total = (np.add.reduceat(np.asarray(part, np.float64), starts, axis=0).T / counts).T
        means.append(total @ shares if total.ndim == 2 else np.repeat(total[:, None], shares.shape[1], axis=1))
    return np.concatenate(means)


def unit_duty(level: Array, rate: float, *, duration: float | None = None, repeats: int = 1) -> Array:
    """Highest mean over any minute of `level`, shape (time, unit), `rate` in Hz; silent before and after.

    `duration` of the level in s is shorter than that of all values if the last one lasts a shorter time.
    """
    lasts = len(level) / rate if duration is None else duration
    edges = np.minimum(np.arange(len(level) + 1) / rate, lasts)
    total = np.concatenate([np.zeros((1, level.shape[1])), np.cumsum(level * np.diff(edges)[:, None], axis=0)])
    end = repeats * lasts
    if end <= MINUTE:
        return np.asarray(repeats * total[-1] / MINUTE, np.float64)

    def until(time: Array) -> Array:
        played, rest = np.divmod(time, lasts)
        return played[:, None] * total[-1] + np.stack([np.interp(rest, edges, each) for each in total.T], axis=1)

    # The busiest minute begins or ends where a value does.
    begin = np.clip(np.concatenate([edges, np.mod(edges - MINUTE, lasts)]), 0, end - MINUTE)
    found = (until(begin + MINUTE) - until(begin)).max(axis=0) / MINUTE
    # Rounding must not lift a mean over the highest value.
    return np.asarray(np.minimum(found, level.max(axis=0)), np.float64)


def skin_warming(intensity: Array, step: float) -> Array:
    """Warming of skin in K by an intensity in W/m2, shape (time,), at times `step` s apart, of the same shape.

    Heat that flows into a thick body from its surface warms that surface with the square root of time (Carslaw and
    Jaeger, Conduction of Heat in Solids, 2.9); earlier heat adds up. The scale is that of the published figure.
    """
    time = np.arange(min(len(intensity), round(MINUTE / step)) + 1) * step
    response = np.diff(np.sqrt(time / PUBLISHED_TIME)) * PUBLISHED_RISE / STRONG_FOCUS
    return np.asarray(np.convolve(intensity, response)[: len(intensity)], np.float64)


def palm_warming(drive: Drive, points: Array, *, acoustics: Acoustics, repeats: int = 1) -> float:
    """Estimate the highest warming of the palm in K at `points`, shape (point, 3) in m, during all repeats."""
    return HeatSoFar(points, drive.frames, acoustics=acoustics, repeats=repeats).add(drive)[1]


class HeatSoFar:
    """Heat of the first frames of a drive that comes in parts and is played `repeats` times.

    `points`, shape (point, 3) in m, are those of the palm, and `frames` is the number of all frames. For all of them
    the heat is exactly that of the whole drive.
    """

    def __init__(self, points: Array, frames: int, *, acoustics: Acoustics, repeats: int = 1) -> None:
        self._points, self._frames, self._acoustics, self._repeats = points, frames, acoustics, repeats
        self._intensity = np.zeros((0, len(points)))
        self._levels = np.zeros((0, 0))
        self._matrix = np.zeros((0, len(points)), np.complex64)
        self._sampled: list[NDArray[np.intp]] = []
        self._warming = 0.0

    def add(self, drive: Drive) -> tuple[Array, float]:
        """Duty of each unit, as `unit_duty`, and warming of the palm in K; `drive` are the frames up to now."""
        size, done = max(1, round(BIN * drive.rate)), drive.frames
        step, times = size / drive.rate, self._repeats if done == self._frames else 1
        if not self._sampled:
            self._matrix = transfer_matrix(self._points, drive.array, acoustics=self._acoustics).T.astype(np.complex64)
            self._sampled = _sampled(self._frames, size)
        # The last bin may have been incomplete.
        whole, end = max(0, len(self._levels) - 1), -(-done // size)
        rest = replace(drive, phase=drive.phase[whole * size :], level=drive.level[whole * size :])
        levels = unit_levels(rest, every=size)
        means = [self._intensity_of(drive, bins[bins < done]) for bins in self._sampled[whole:end]]
        self._levels = np.concatenate([self._levels[:whole], levels]) if whole else levels
        self._intensity = np.concatenate([self._intensity[:whole], means])
        # Earlier heat adds up for a minute.
        recent = self._intensity[max(0, whole - round(MINUTE / step)) :] if times == 1 else self._intensity
        again = min(times, int(np.ceil(MINUTE / (step * len(recent)))) + 1)
        # One point after the other, which needs less memory.
        warming = max(float(skin_warming(np.tile(each, again), step).max(initial=0.0)) for each in recent.T)
        self._warming = max(self._warming, warming)
        return unit_duty(self._levels, 1 / step, duration=done / drive.rate, repeats=times), self._warming

    def _intensity_of(self, drive: Drive, frames: NDArray[np.intp]) -> Array:
        """Mean intensity at each point in W/m2; that of the last frame without frames."""
        q = drive.q_of(frames if len(frames) else np.array([drive.frames - 1]))
        field = q.astype(np.complex64) @ self._matrix
        return np.mean(np.abs(field) ** 2, axis=0) / (2 * self._acoustics.medium.density * self._acoustics.medium.speed)


def _sampled(frames: int, size: int) -> list[NDArray[np.intp]]:
    """Frames of each bin; multiples of the golden ratio, so that no periodic drive is always met at one phase."""
    starts = np.arange(0, frames, size)
    if frames <= _FRAMES:
        return [np.arange(first, min(first + size, frames)) for first in starts]
    count = max(_FEWEST, _FRAMES // len(starts))
    share = np.mod(np.arange(len(starts) * count) * (np.sqrt(5) - 1) / 2, 1).reshape(-1, count)
    return [
        np.unique(first + (each * min(size, frames - first)).astype(int))
        for first, each in zip(starts, share, strict=True)
    ]
