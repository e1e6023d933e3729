"""Heat of a drive: mean level of the array's units, and an estimate of how much the palm warms."""

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
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
    response = _warming_response(len(intensity), step)
    return np.asarray(np.convolve(intensity, response)[: len(intensity)], np.float64)


def _warming_response(bins: int, step: float) -> Array:
    """Warming in K after 1 W/m2 in one bin, at the end of each bin of up to a minute."""
    time = np.arange(min(bins, round(MINUTE / step)) + 1) * step
    return np.asarray(np.diff(np.sqrt(time / PUBLISHED_TIME)) * PUBLISHED_RISE / STRONG_FOCUS, np.float64)


def palm_warming(drive: Drive, points: Array, *, acoustics: Acoustics, repeats: int = 1) -> float:
    """Estimate the highest warming of the palm in K at `points`, shape (point, 3) in m, during all repeats."""
    intensity = _palm_intensity(drive, points, acoustics)
    return _warmest(intensity, bin_frames(drive.rate) / drive.rate, repeats)


def _warmest(intensity: Array | Single, step: float, repeats: int) -> float:
    """Highest warming at any point, (bin, point) `step` s apart, during all repeats."""
    times = min(repeats, int(np.ceil(MINUTE / (step * len(intensity)))) + 1)
    # One point after the other, which needs less memory.
    return max(float(skin_warming(np.tile(each, times), step).max(initial=0.0)) for each in intensity.T)


def bin_frames(rate: float) -> int:
    """Frames of a bin at a rate in Hz."""
    return max(1, round(BIN * rate))


def _palm_intensity(drive: Drive, points: Array, acoustics: Acoustics) -> Array:
    """Mean intensity in each bin at each point, shape (bin, point), in W/m2."""
    matrix = transfer_matrix(points, drive.array, acoustics=acoustics).T.astype(np.complex64)
    impedance = acoustics.medium.density * acoustics.medium.speed
    return np.asarray(
        [
            np.mean(np.abs(_frames(drive, each) @ matrix) ** 2, axis=0) / (2 * impedance)
            for each in _sampled(drive.frames, bin_frames(drive.rate))
        ],
        np.float64,
    )


class HeatHistory:
    """Heat of a drive that comes in parts, each of whole bins except the last."""

    def __init__(self) -> None:
        self._levels: list[Array] = []
        self._intensity: Single | None = None
        self._warmest, self._frames, self._rate = 0.0, 0, 1.0

    def add(self, part: Drive, points: Array, *, acoustics: Acoustics) -> tuple[Array, float]:
        """Add the next part; return `unit_duty` and `palm_warming` of all parts so far."""
        every = bin_frames(part.rate)
        self._levels.append(unit_levels(part, every=every))
        self._frames += part.frames
        new = _palm_intensity(part, points, acoustics).astype(np.float32)
        earlier = new[:0] if self._intensity is None else self._intensity
        step, known = every / part.rate, np.concatenate([earlier, new])
        response = _warming_response(len(known), step)
        for end in range(len(earlier) + 1, len(known) + 1):
            last = known[max(0, end - len(response)) : end]
            self._warmest = max(self._warmest, float((response[: len(last)][::-1] @ last).max()))
        self._intensity = known
        self._rate = part.rate
        return self._duty(1), self._warmest

    def repeated(self, repeats: int) -> tuple[Array, float]:
        """The same of all parts in a loop."""
        known = np.zeros((1, 1)) if self._intensity is None else self._intensity
        return self._duty(repeats), _warmest(known, bin_frames(self._rate) / self._rate, repeats)

    def _duty(self, repeats: int) -> Array:
        levels, rate = np.concatenate(self._levels), self._rate
        return unit_duty(levels, rate / bin_frames(rate), duration=self._frames / rate, repeats=repeats)


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


def _frames(drive: Drive, which: NDArray[np.intp]) -> NDArray[np.complex64]:
    phase = np.asarray(drive.phase[which])
    level = np.asarray(drive.level[which]).reshape(len(phase), -1)
    return np.asarray(level * np.exp(1j * phase), np.complex64)
