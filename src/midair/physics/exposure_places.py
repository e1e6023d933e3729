"""Exposure of places: limits at ears and hands, with the points searched around them; heat of a drive and of a palm."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.model import Acoustics, Drive, TransducerArray
from midair.physics.propagation import transfer_matrix, wavenumber
from midair.streaming import blocks
from midair.validation import within

MOST_PROTECTION = 40.0
"""Largest attenuation of ear protection that can be stated, in dB."""


def combined(*axes: Array) -> Array:
    """All combinations of coordinates, shape (point, axis), the last coordinate changing fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)).astype(np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Place of an ear or a hand, and its limit."""

    name: str
    """Such as "left ear"."""
    position: tuple[float, float, float]
    """x, y, z from the centre of the array, in m."""
    reach: float
    """Half the edge of the cube around it that is searched, in m."""
    limit: float
    """Maximum sound pressure level of any frame, in dB."""
    enforced: bool = True
    """True if playing above the limit is refused; False if the level is only reported."""
    source: str = ""
    """Source of the limit, if it differs from the profile's source."""

    @property
    def points(self) -> Array:
        """3 x 3 x 3 points of the cube, shape (27, 3), in m."""
        steps = np.array([-1.0, 0.0, 1.0]) * self.reach
        return combined(steps, steps, steps) + np.array(self.position)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureProfile:
    """A named set of limits."""

    name: str
    title: str
    """The people whom the limits protect."""
    source: str
    """Source of the limits."""
    evidence: str
    """Quality of the evidence."""
    places: tuple[Place, ...]
    """The places at which levels are limited; at least one."""
    duty: float = 0.5
    """Highest mean level of a unit over a minute, 0 to 1; midair's own value, since the makers state none."""
    warming: float = 6.0
    """Highest estimated warming of the palm in K: from 35 °C to the 41 °C of IEC 60601-1 for parts on skin."""
    hours: float = 24.0
    """Longest exposure of a person a day for which the source states the limits, in hours."""
    protection: float = 0.0
    """Attenuation of ear protection in dB, as stated by the user, by which the enforced limits are higher."""

    def under(self, limit: float) -> "ExposureProfile":
        """The profile with the same limit in dB at all enforced places."""
        places = tuple(replace(place, limit=limit) if place.enforced else place for place in self.places)
        return replace(self, name=f"{limit:g} dB", title=f"{limit:g} dB at the ears", places=places)

    def behind(self, attenuation: float) -> "ExposureProfile":
        """The profile for people whose ear protection attenuates by this many dB at 40 kHz, as stated by the user.

        0 dB returns the profile itself. Raises InputError outside of 0 to 40 dB, a value of midair against slips.
        """
        advice = "use the figure of a measurement at 40 kHz, not the rating for audible noise"
        within(attenuation, "ear protection", 0, MOST_PROTECTION, unit="dB at 40 kHz", advice=advice)
        if not attenuation:
            return self
        name = f"{self.name}, {attenuation:g} dB of ear protection stated by the user"
        places = tuple(
            replace(place, limit=place.limit + attenuation) if place.enforced else place for place in self.places
        )
        return replace(self, name=name, places=places, protection=attenuation)

    @property
    def nearest(self) -> tuple[int, Place]:
        """Index and place nearest to the array, which is the palm."""
        number = int(np.argmin([np.linalg.norm(place.position) for place in self.places]))
        return number, self.places[number]


def cone_points(place: Place, array: TransducerArray, acoustics: Acoustics, *, step: float) -> Array:
    """Points of a place's cube with the spacing at which the sound can change, shape (point, 3), in m.

    Across the cone they form a checkerboard, along it prisms. Points outside the cube are moved to its surface. `step`
    is the largest change, from a point to the next, of the phase between two waves from the edges of the cone, in rad.
    """
    away = place.points[:, None, :] - array.position[None, :, :]
    axes, half = _cone((away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3))
    reach = place.reach
    # The cone of one transducer is a line: limit the spacing to the width of the cube.
    apart = np.minimum(step / np.maximum(wavenumber(array, acoustics.medium) * half, 1e-9), 2 * reach)
    count = np.ceil(reach * np.abs(axes).sum(axis=1) / apart).astype(int) + 1
    i, j, k = combined(*[np.arange(-n, n + 1) for n in count]).T
    white = (i + j) % 2 == 0
    steps = np.stack([i, j, k + 0.5 * (i % 2)], axis=1)[white]
    free = steps * apart @ axes
    kept = np.clip(free, -reach, reach)
    moved = np.abs((kept - free) @ axes.T) / apart
    # Points moved by more than one and a half prisms represent nothing inside.
    kept = kept[(moved[:, 0] + moved[:, 1] <= 1.5) & (moved[:, 2] <= 0.8)]
    return np.unique(np.round(kept, 4), axis=0) + np.array(place.position)


def _cone(directions: Array) -> tuple[Array, Array]:
    """Axes of the cone of these directions, one per row, the last one along it; and its half width along each."""
    along = directions.mean(axis=0)
    along /= np.linalg.norm(along)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.cross(along, aside)
    # Rotate to the smallest width: a square array would seem twice as large along its diagonal.
    turned = [
        np.stack([np.cos(turn) * aside + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * aside, along])
        for turn in np.radians(np.arange(0, 90, 7.5))
    ]
    widths = [np.ptp(directions @ axes.T, axis=0) / 2 for axes in turned]
    best = int(np.argmin([width[0] * width[1] for width in widths]))
    return turned[best], widths[best]


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


def small_angle(phase: Array, angle: Single) -> Single:
    """Write phases into `angle` in single precision, without whole turns if they are many, which would cost digits."""
    with np.errstate(over="ignore"):
        angle[:] = phase
    # Files may contain any phase.
    if max(angle.max(initial=0.0), -angle.min(initial=0.0)) > 64:
        angle[:] = np.remainder(phase, 2 * np.pi)
    return angle


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
        some = frames if len(frames) else np.array([drive.frames - 1])
        phase, level = np.asarray(drive.phase[some]), np.asarray(drive.level[some], np.float32).reshape(len(some), -1)
        angle, q = small_angle(phase, np.empty(phase.shape, np.float32)), np.empty(phase.shape, np.complex64)
        np.multiply(level, np.cos(angle), out=q.real)
        np.multiply(level, np.sin(angle), out=q.imag)
        field = q @ self._matrix
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
