"""The loudest sound at the places of a profile while frames arrive.

Sound of one frame arrives from the transducers within .7 ms, so that an ear hears near transducers already with the
next frame. Transducers are grouped by the time at which their sound arrives at the middle of a place; at each moment
each group sounds with the frame that has arrived from it. The modes of such a mix are sums of the modes of groups. One
moment of each frame is searched. Where the difference of modes, or what a place can hide, could be louder between two
of them, the same is done for all moments in the octants of the place, each with its own times of arrival.
"""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, partial
from math import ceil
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.model import Drive
from midair.physics.exposure_modes import Workspace, drive_parts, modes_of, power_of
from midair.physics.exposure_places import ExposureProfile
from midair.physics.exposure_search import Airs, PlaceSearch, Searches, searches_of
from midair.progress import report_progress

MOMENTS, FINE = 125e-6, 31.25e-6
"""Longest time in s between two moments of a whole place and of its octants; a frame has at least two moments."""

ROUGH = 0.08
"""This share of the change of all transducers in step, from a frame to the next, is added to moments at 4 kHz for each
frame by which sound arrives before or after that of the middle of its octant; it grows with the root of the rate."""

HIDDEN = 10e-6
"""Time in s: its share of a second, and .02, of this change bound what moments of a whole place can hide. Found, as
`ROUGH`, from drives that were made for it (docs/decisions/0015-exposure-bound.md)."""

TRUNCATED = 4e-4
"""Allowed truncation error of the modes of an octant, relative to the sum of all transducers."""

BLOCK = 256
"""Frames that are computed at once."""

_FEW = 32
"""Frames whose octants are computed at once."""

_SHARE = 16
"""Blocks per thread between two progress reports."""

Complex = NDArray[np.complex64]
Frames = NDArray[np.intp]
Moment = tuple[Single, float]
"""Modes at a moment of each frame, (parts x mode, frame), and the share of transducers whose frame has arrived."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arrivals:
    """Transducers, in groups by the arrival of their sound at a part of a place, and the modes of their sound there."""

    groups: tuple[tuple[Frames, Single], ...]
    """Transducers, in the order of their arrival, and the matrix from their parts to those of modes."""
    count: int
    """Moments of a frame: the groups arrive one after the other, this many in the time of a frame."""

    @classmethod
    def of(cls, modes: Complex, late: Array, rate: float, apart: float) -> Self:
        """From modes (mode, transducer), arrivals (transducer,) in s, the rate of frames in Hz and the longest time
        between two moments in s.
        """
        count = max(2, ceil(1 / (rate * apart) - 1e-6))
        number = (late * rate * count).astype(np.intp)
        members = [np.flatnonzero(number == each) for each in range(number.max() + 1)]
        parts = in_parts(modes).reshape(2 * len(modes), 2, -1)
        return cls(groups=tuple((each, parts[:, :, each].reshape(len(parts), -1)) for each in members), count=count)

    def moments(self, parts: Single, reach: int, space: Workspace) -> list[Moment]:
        """The moments of each frame, from the last one of the frame before to its own last one.

        `parts` are real and imaginary parts of the drive, float32 (2, transducer, reach + frame): the frames, and those
        that sound beside the first.
        """
        whole, number, size = parts.shape[2], len(self.groups), len(self.groups[0][1])
        frames, groups = whole - reach, space.array("groups", number, size, whole)
        for (members, matrix), into in zip(self.groups, groups, strict=True):
            own = space.array("members", 2, len(members), whole)
            np.take(parts, members, axis=1, out=own, mode="clip")
            np.matmul(matrix, own.reshape(2 * len(members), whole), out=into)
        ends = space.array("ends", size, frames + 1)
        ends[:] = 0
        for group, each in enumerate(groups):
            first = reach - 1 - group // self.count
            ends += each[:, first : first + frames + 1]
        found, arrived = [(ends[:, :-1], 0.0)], 0
        for moment, mixed in enumerate(space.array("mixed", min(self.count, number) - 1, size, frames)):
            mixed[:] = found[-1][0]
            for group in range(moment, number, self.count):
                first = reach - group // self.count
                mixed += groups[group, :, first : first + frames]
                mixed -= groups[group, :, first - 1 : first - 1 + frames]
                arrived += len(self.groups[group][0])
            found.append((mixed, arrived / parts.shape[1]))
        return [*found, (ends[:, 1:], 1.0)]


def in_parts(matrix: Complex) -> Single:
    """The matrix for real parts followed by imaginary parts."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]]).astype(np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceInTime:
    """Computes the last moment of each frame at a place, and bounds those before it."""

    search: PlaceSearch
    arrivals: Arrivals
    squares: Single
    """Squared weights of parts of modes, shape (parts x mode,), in Pa2: the norm of weighted modes is at least the
    magnitude at any point and air."""
    spread: float
    """Longest time in s from the first to the last arrival at any point."""

    def last_moments(self, parts: Single, reach: int, space: Workspace) -> tuple[Array, Array]:
        """Amplitude at the last moment of each frame, shape (air, frame), and the most that it is exceeded before.

        The excess (frame,) is above the louder of this and the last moment of the frame before; both in Pa.
        """
        each = self.arrivals.moments(parts, reach, space)
        excess = np.zeros(each[-1][0].shape[1])
        for middle in each[1:-1]:
            excess = np.maximum(excess, _apart(middle, each[0], each[-1], self.squares)[0])
        return self._amplitude(each[-1][0], space), excess

    def other_moments(
        self, parts: Single, reach: int, ends: Array, hidden: Array, loudest: float, space: Workspace
    ) -> Array:
        """Amplitude at the loudest moment before the last of each frame, shape (air, frame), in Pa.

        It is 0 for moments that cannot exceed `loudest` by what may be `hidden` (frame,); `ends` (2, frame) are the
        last moments of the frame before and of this one, in Pa. Moments are bounded by measured ones, by bisection.
        """
        each = self.arrivals.moments(parts, reach, space)
        found = np.zeros((len(self.search.airs), ends.shape[1]))
        _louder_between(found, each, ends, loudest - hidden, self.squares, partial(self._amplitude, space=space))
        return found

    def _amplitude(self, modes: Single, space: Workspace) -> Array:
        real, imaginary = modes.reshape(2, -1, modes.shape[1]).transpose(0, 2, 1)
        return self.search.loudest(np.stack([real, imaginary, real + imaginary]), space)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Octant:
    """Computes the loudest moments in an octant of a place."""

    arrivals: Arrivals
    points: Single
    """From parts of modes to parts of the pressure in Pa, shape (parts x air x point, parts x mode)."""
    airs: int
    squares: Single
    """Those of `PlaceInTime`."""
    rough: float
    """Longest time in s by which sound arrives before or after that of the middle."""
    left_out: float
    """Truncation error anywhere with every transducer at full drive, in Pa."""

    def loudest(self, parts: Single, reach: int, above: float, space: Workspace) -> Array:
        """Amplitude at the loudest moment of each frame, (air, frame), in Pa; 0 where it cannot exceed `above`.

        `parts` and `reach` are those of `Arrivals.moments`.
        """
        each = self.arrivals.moments(parts, reach, space)
        ends = self._amplitude(np.concatenate([each[0][0][:, :1], each[-1][0]], axis=1))
        found, most = ends[:, 1:].copy(), np.stack([ends[:, :-1].max(axis=0), ends[:, 1:].max(axis=0)])
        _louder_between(found, each, most, np.full(found.shape[1], above), self.squares, self._amplitude)
        return found

    def _amplitude(self, modes: Single) -> Array:
        field = (self.points @ modes).reshape(2, -1, modes.shape[1])
        return np.sqrt(power_of(field).reshape(self.airs, -1, modes.shape[1]).max(axis=1)).astype(np.float64)


def _louder_between(
    found: Array, each: list[Moment], ends: Array, above: Array, squares: Single, amplitude: Callable[[Single], Array]
) -> None:
    """Raise the amplitudes `found` (air, frame) to those at moments that can exceed `above` (frame,), in Pa.

    Moments are bounded by measured ones, by bisection; `ends` (2, frame) are the amplitudes at the first and the last
    of them, and `squares` those of `PlaceInTime`.
    """
    most, spans = {0: ends[0], len(each) - 1: ends[1]}, [(0, len(each) - 1)]
    while spans := [span for span in spans if span[1] > span[0] + 1]:
        middles = [sum(span) // 2 for span in spans]
        for (first, final), middle in zip(spans, middles, strict=True):
            apart, share = _apart(each[middle], each[first], each[final], squares)
            most[middle] = (1 - share) * most[first] + share * most[final] + apart
        some = {middle: np.flatnonzero(most[middle] > above) for middle in middles}
        modes = np.concatenate([each[middle][0][:, own] for middle, own in some.items()], axis=1)
        if modes.size:
            counts = np.cumsum([len(own) for own in some.values()])
            for (middle, own), part in zip(some.items(), np.split(amplitude(modes), counts[:-1], axis=1), strict=True):
                found[:, own], most[middle][own] = np.maximum(found[:, own], part), part.max(axis=0)
        spans = [pair for (first, final), m in zip(spans, middles, strict=True) for pair in ((first, m), (m, final))]


def _apart(middle: Moment, first: Moment, final: Moment, squares: Single) -> tuple[Array, float]:
    """Bound of the distance of modes at a moment from a mean of those at two others, (frame,), in Pa, and the weight of
    the second of them in it.
    """
    share = (middle[1] - first[1]) / max(final[1] - first[1], 1e-9)
    rest = middle[0] - np.float32(share) * final[0]
    rest -= np.float32(1 - share) * first[0]
    return np.sqrt(squares @ np.square(rest, out=rest)), share


@lru_cache(maxsize=32)
def place_in_time(search: PlaceSearch, rate: float) -> PlaceInTime:
    """A place for frames at `rate` in Hz."""
    arrivals = Arrivals.of(search.modes, search.late(search.points.mean(axis=0)[None])[0], rate, MOMENTS)
    weights = 1.0 if search.field is None else _weights(search.at_points(), search.modes)
    squares = np.broadcast_to(np.square(search.allowed * weights), len(search.modes)).astype(np.float32)
    spread = float(search.late(search.points).max())
    return PlaceInTime(search=search, arrivals=arrivals, squares=np.tile(squares, 2), spread=spread)


def _weights(field: Complex, modes: Complex) -> Array:
    """Weights of modes, (mode,), in Pa: the norm of weighted modes is at least the magnitude at any point and air.

    They make this bound low for modes as strong as those of unrelated transducers. Found like an optimal design, by
    multiplicative steps for the share of each point (Silvey, Titterington & Torsney 1978, Communications in Statistics
    7, 1379).
    """
    power = np.square(np.abs(field.reshape(-1, field.shape[2]))).T
    strength = np.square(np.abs(modes)).sum(axis=1)
    squares, at_points = np.ones(len(modes), np.float32), np.ones(power.shape[1], np.float32)
    share = at_points / len(at_points)
    for _ in range(30):
        squares = np.sqrt(power @ share / strength)
        at_points = (1 / squares) @ power
        share *= at_points / (share @ at_points)
    return np.asarray(np.sqrt(squares * at_points.max()), np.float64)


def _modes_at(field: Complex, search: PlaceSearch) -> tuple[Complex, Complex, float]:
    """Shapes (point, mode), modes (mode, transducer) and `left_out` of points that `field` computes from modes."""
    if search.field is None:
        return np.eye(len(field), dtype=np.complex64), field @ search.modes, 0.0
    # The modes of a place are orthogonal: in units of their norms, those of its parts need no sum over transducers.
    norms, root = np.linalg.norm(search.modes, axis=1), np.sqrt(search.modes.shape[1])
    enough = TRUNCATED * float(search.ceiling.sum()) * np.sqrt(len(norms)) / root
    shapes, turned = modes_of(field * norms, len(norms), enough)
    rest = field - shapes @ (turned := turned / norms)
    # The sum over all transducers is at most `root` norms; it is computed where it can be the highest.
    most = np.linalg.norm(rest * norms, axis=1) * root
    some = most >= 0.999 * np.abs(rest[most.argmax()] @ search.modes).sum()
    return shapes, turned @ search.modes, float(np.abs(rest[some] @ search.modes).sum(axis=1).max())


@lru_cache(maxsize=32)
def octants_of(search: PlaceSearch, rate: float) -> tuple[Octant, ...]:
    """The octants of a place for frames at `rate` in Hz."""
    low, high = search.points.min(axis=0), search.points.max(axis=0)
    number = (search.points >= (low + high) / 2) @ 2 ** np.arange(3)
    field, found = search.at_points(), []
    for each in np.unique(number):
        points = search.points[number == each]
        shapes, modes, left_out = _modes_at(field[:, number == each].reshape(-1, field.shape[2]), search)
        late = search.late((points.min(axis=0, keepdims=True) + points.max(axis=0)) / 2)
        points_of = in_parts(np.complex64(search.allowed) * shapes)
        octant = Octant(
            arrivals=Arrivals.of(modes, late[0], rate, FINE),
            points=points_of,
            airs=len(search.airs),
            squares=np.full(points_of.shape[1], np.square(points_of).sum(axis=1).max()),
            rough=float(np.abs(search.late(points) - late).max()),
            left_out=left_out,
        )
        found.append(octant)
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SoundInTime:
    """Measures a drive at the places of a profile."""

    drive: Drive
    steps: int | None
    searches: Searches
    each: tuple[PlaceInTime | Searches, ...]
    """The search of each place, in time where its limit is enforced."""
    lead: int
    """Number of frames before the first measured one that sound beside it or the one before it; 0 for frames alone."""

    @classmethod
    def of(cls, drive: Drive, profile: ExposureProfile, airs: Airs, steps: int | None, *, alone: bool = False) -> Self:
        """The drive at the places; with `alone`, each frame is measured as if it lasted."""
        searches = searches_of(profile.places, drive.array, airs)
        each = tuple(
            place_in_time(search, drive.rate) if place.enforced and not alone else Searches.of(search)
            for search, place in zip(searches.each, profile.places, strict=True)
        )
        spread = [one.spread for one in each if isinstance(one, PlaceInTime)]
        lead = 2 + int((max(spread) + 1e-6) * drive.rate) if spread else 0
        return cls(drive=drive, steps=steps, searches=searches, each=each, lead=lead)

    def measure(self, run: Frames, mapped: Callable[..., Iterable[Any]]) -> tuple[Frames, Array, NDArray[np.int8]]:
        """The frames of a run after its first `lead`, (frame,); amplitude and loudest air at each place, each
        (frame, place), in Pa. `mapped` is `map`, of several threads. A frame of -1 is silence.
        """
        cores = os.cpu_count() or 1
        # The frame before the first one is measured to bound what sounds between them.
        firsts = np.arange(0, len(run) - self._reach, BLOCK)
        # Each share has its own arrays; more shares than cores, so that progress is reported often enough.
        shares = np.array_split(firsts, max(cores, len(firsts) // _SHARE))
        parts = report_progress(mapped(partial(self._last_moments, run), shares), len(shares))
        amplitude, air, excess, change, level = (np.concatenate(each) for each in zip(*parts, strict=True))
        if self.lead:
            ends = np.stack([amplitude[:-1], amplitude[1:]])
            amplitude, air, excess, change, level = (each[1:] for each in (amplitude, air, excess, change, level))
            places = [place for place, each in enumerate(self.each) if isinstance(each, PlaceInTime)]
            others = partial(self._other_moments, run[1:], ends, excess, change, level)
            for place, (found, loudest) in zip(places, mapped(others, places), strict=True):
                louder = found > amplitude[:, place]
                amplitude[louder, place], air[louder, place] = found[louder], loudest[louder]
        return run[self.lead :], self.searches.bounded(amplitude, level), air.astype(np.int8)

    def _last_moments(self, run: Frames, firsts: NDArray[np.intp]) -> tuple[Array, ...]:
        """Last moments of blocks of frames: amplitude, air, bound of the excess before and highest change with all
        transducers in step, each (frame, place); highest level (frame,) of what sounds.
        """
        space, reach = Workspace(), self._reach
        found = [(*np.zeros((4, 0, len(self.each))), np.zeros(0))]
        for first in firsts:
            parts, level = self._parts(run[first : first + BLOCK + reach], space)
            amplitude, air, excess, change = np.zeros((4, parts.shape[1] - reach, len(self.each)))
            frames_last = np.ascontiguousarray(parts[:2].transpose(0, 2, 1))
            for place, search in enumerate(self.each):
                if isinstance(search, PlaceInTime):
                    each, excess[:, place] = search.last_moments(frames_last, reach, space)
                else:
                    each = search.loudest(parts[:, reach:], space)[:, :, 0]
                amplitude[:, place], air[:, place] = each.max(axis=0), each.argmax(axis=0)
            if reach:
                real, imaginary = np.square(np.diff(parts[:2], axis=1))
                change[:] = _highest(np.sqrt(real + imaginary) @ self.searches.ceiling, reach)
            found.append((amplitude, air, excess, change, _highest(level, reach + 1)))
        return tuple(np.concatenate(each) for each in zip(*found, strict=True))

    def _other_moments(
        self, run: Frames, ends: Array, excess: Array, change: Array, level: Array, place: int
    ) -> tuple[Array, Array]:
        """Amplitude and air of the moments that can be the loudest of all at one place, each (frame,)."""
        space, rate = Workspace(), self.drive.rate
        search, ends, change = self.searches.each[place], ends[:, :, place], change[:, place]
        pairs = ends.max(axis=0)
        timed = place_in_time(search, rate)
        hidden, rough = (0.02 + HIDDEN * rate) * change, ROUGH * rate * (rate / 4000) ** 0.5 * change
        found, air, bound = np.zeros(len(pairs)), np.zeros(len(pairs)), pairs + excess[:, place] + hidden
        loudest, firsts = pairs.max(initial=0.0), np.arange(0, len(pairs), _FEW)

        def parts_of(own: slice) -> Single:
            parts, _ = self._parts(run[own.start : own.stop + self._reach], space)
            return np.ascontiguousarray(parts[:2].transpose(0, 2, 1))

        def keep(own: slice, each: Array, added: Array | float) -> None:
            most, loud = each.max(axis=0) + added, each.argmax(axis=0)
            louder = most > found[own]
            found[own][louder], air[own][louder] = most[louder], loud[louder]

        most = np.maximum.reduceat(bound, firsts)
        for first in firsts[np.argsort(-most, kind="stable")]:
            some = first + np.flatnonzero(bound[first : first + _FEW] > loudest)
            if not len(some):
                break
            own = slice(some[0], some[-1] + 1)
            keep(own, timed.other_moments(parts_of(own), self._reach, ends[:, own], hidden[own], loudest, space), 0.0)
            loudest = max(loudest, found[own].max())
            some = own.start + np.flatnonzero(np.maximum(pairs, found)[own] + hidden[own] > loudest)
            if not len(some):
                continue
            own = slice(some[0], some[-1] + 1)
            parts = parts_of(own)
            for octant in octants_of(search, rate):
                added = octant.rough * rough[own] + octant.left_out * level[own]
                above = max(0.0, loudest - float(added.max()))
                keep(own, octant.loudest(parts, self._reach, above, space), added)
                loudest = max(loudest, found[own].max())
        return found, air

    @property
    def _reach(self) -> int:
        """Number of earlier frames that sound beside a frame."""
        return max(self.lead - 1, 0)

    def _parts(self, frames: Frames, space: Workspace) -> tuple[Single, Array]:
        """`drive_parts` of the frames."""
        first, last = int(frames[0]), int(frames[-1])
        # Small blocks stay in the cache; a whole drive at all points would not fit into memory.
        wanted = slice(first, last + 1) if 0 <= first == last + 1 - len(frames) else np.maximum(frames, 0)
        parts, level = drive_parts(self.drive, wanted, space, steps=self.steps)
        parts[:, frames < 0], level[frames < 0] = 0, 0
        return parts, level


def _highest(values: Array, count: int) -> Array:
    """Highest of each value and those before it, of as many as `count`, along the first axis."""
    return np.lib.stride_tricks.sliding_window_view(values, count, axis=0).max(axis=-1)
