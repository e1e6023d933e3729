"""The loudest sound anywhere in a cube, for every frame of a drive, from few points and at little cost.

Sound from an array comes to a cube from a narrow cone, so that its magnitude cannot change faster than the width of
that cone lets it. It is looked at on lattices, a close one on the faces of the cube, behind which nothing holds it, and
a wider one inside. A finite number of points still misses something; `ALLOWANCE` is put on for that, and
docs/decisions/0015-exposure-bound.md says how much the best of all drives can hide all the same.

A field that comes from a cone has few degrees of freedom, about 120 in the cube around an ear instead of one for each
of 996 transducers. The field is worked out in these modes, from there on a few planes, and between them along the one
edge of the cube, in single precision. What all that leaves out is measured, and added.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.exposure_search.exposure_grid import bands, slow_field, stacks
from midair.physics.exposure_search.exposure_mirror import Halves, Pair, mirrored, pair_of
from midair.physics.exposure_search.exposure_modes import FieldByModes, heard_by_modes
from midair.physics.exposure_search.exposure_products import Product, Workspace, power_of
from midair.physics.propagation import transfer_matrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex64]
Airs = tuple[Acoustics, ...]

ALLOWANCE = 1.15
"""Put on the loudest point of a cube, in dB: between points and airs it can be this much louder, and a little more."""

INSIDE, FACES = 1.6, 1.2
"""By how much the phase of the quickest wave may change from a point to the next, in rad."""

NODES = 1.9
"""The same between points from which the field everywhere else in the cube follows, in rad."""

ENOUGH = 8e-4
"""Of all transducers in step: about as much as the modes may leave out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointSearch:
    """The loudest of a few points, of a place that only advises.

    Attributes
    ----------
    modes : ndarray of complex, shape (air x point, transducer)
        From the drive to the pressure at the points in each air, in Pa.
    airs : int
        How many airs there are.
    ceiling : ndarray, shape (transducer,)
        Most that each transducer alone makes there, in Pa; all together cannot make more than the sum.
    left_out : float
        As that of `CubeSearch`: nothing.
    """

    modes: Complex
    ceiling: Array
    airs: int
    left_out: float = 0.0

    def loudest(self, modes: Single, space: Workspace) -> Array:
        """As that of `CubeSearch`, of the points alone."""
        there = space.array("there", 2, *modes.shape[1:])
        there[:] = modes[:2]
        power = power_of(there).reshape(modes.shape[1], self.airs, -1).max(axis=2).T
        # There is nothing between points of which each counts alone, but something between airs.
        return np.sqrt(power).astype(np.float64) * (10 ** (ALLOWANCE / 20) if self.airs > 1 else 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CubeSearch:
    """How the loudest sound in the cube of one place follows from what the transducers are told.

    Attributes
    ----------
    heard : FieldByModes
        From the modes of the drive to the pressure at all points.
    ceiling : ndarray, shape (transducer,)
        As that of `PointSearch`, of all of the cube.
    """

    heard: FieldByModes
    ceiling: Array

    @property
    def modes(self) -> Complex:
        """From the drive to its modes, shape (mode, transducer)."""
        return self.heard.modes

    @property
    def airs(self) -> int:
        """How many airs there are."""
        return len(self.heard.shapes)

    @property
    def left_out(self) -> float:
        """Most that the modes leave out anywhere when every transducer is at full drive, in Pa."""
        return self.heard.left_out

    def loudest(self, modes: Single, space: Workspace) -> Array:
        """Amplitude that no place in the cube exceeds but by what the docs say, shape (air, frame), in Pa.

        What is left out is to be added.

        Parameters
        ----------
        modes : ndarray of float32, shape (3, frame, mode)
            Real parts of the modes, their imaginary parts, and the sums of both.
        space : Workspace
            Of the thread that asks.
        """
        return 10 ** (ALLOWANCE / 20) * self.heard.loudest(modes, space).astype(np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searches:
    """The searches of several places in some airs, in one go.

    Attributes
    ----------
    each : tuple of CubeSearch or PointSearch
        Of each place.
    modes : Product
        From the drive to the modes of all places but a pair, one after the other: one large product takes less than
        many.
    pair : tuple of two int
        Numbers of two places that mirror each other; empty where none do.
    halves : Halves or None
        From the drive to the modes of these two.
    """

    each: tuple[CubeSearch | PointSearch, ...]
    modes: Product
    pair: tuple[int, ...] = ()
    halves: Halves | None = None

    @classmethod
    def of(cls, *each: CubeSearch | PointSearch) -> Self:
        """Of one array, each by itself."""
        return cls(each=each, modes=Product.of(np.concatenate([one.modes for one in each]).T))

    @classmethod
    def with_pair(cls, each: tuple[CubeSearch | PointSearch, ...], pair: Pair, halves: Halves) -> Self:
        """Of one array, two of them by its symmetry."""
        rest = [one.modes for number, one in enumerate(each) if number not in pair.numbers]
        none = np.empty((0, len(halves.order)), np.complex64)
        together = np.concatenate([none, *rest])[:, halves.order]
        return cls(each=each, modes=Product.of(together.T), pair=pair.numbers, halves=halves)

    @property
    def airs(self) -> int:
        """How many airs there are."""
        return self.each[0].airs

    @property
    def order(self) -> NDArray[np.intp] | None:
        """In which the transducers are wanted; None for their own."""
        return None if self.halves is None else self.halves.order

    def loudest(self, parts: Single, space: Workspace) -> Array:
        """Amplitude at each place in each air, shape (air, frame, place), in Pa, but for what is left out.

        Parameters
        ----------
        parts : ndarray of float32, shape (3, frame, transducer)
            Real parts of the drive, its imaginary parts, and the sums of both, in `order`.
        space : Workspace
            Of the thread that asks.
        """
        frames = parts.shape[1]
        found = np.empty((self.airs, frames, len(self.each)))
        rest = [number for number in range(len(self.each)) if number not in self.pair]
        if rest:
            modes = space.array("modes", 3, frames, self.modes.width)
            self.modes.into(modes, parts, space)
            np.add(modes[0], modes[1], out=modes[2])
            own = np.split(modes, np.cumsum([len(self.each[number].modes) for number in rest])[:-1], axis=2)
            for number, its in zip(rest, own, strict=True):
                found[..., number] = self.each[number].loudest(its, space)
        if self.halves is not None:
            width = self.halves.common.width
            both = space.array("modes of a pair", 2, 3, frames, width)
            self.halves.into(both[0], both[1], parts, space)
            for number, its in zip(self.pair, both, strict=True):
                found[..., number] = self.each[number].loudest(its, space)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Alike:
    """An array that is the same as any other of its numbers: each file of a drive makes one of its own."""

    array: TransducerArray

    @property
    def numbers(self) -> tuple[object, ...]:
        """All that sound in the air depends on."""
        one = self.array
        return one.position.tobytes(), one.normal.tobytes(), one.pressure, one.frequency, one.response.tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Alike) and self.numbers == other.numbers

    def __hash__(self) -> int:
        return hash(self.numbers)


def cube_search(place: Place, array: TransducerArray, airs: Airs) -> CubeSearch | PointSearch:
    """The search of a place: all of its cube where the limit is enforced, its 27 points where it only advises.

    Kept, since a drive is measured in parts, more than once, and one drive after the other.
    """
    return _cube_search(place, _Alike(array), airs)


def searches_of(places: tuple[Place, ...], array: TransducerArray, airs: Airs) -> Searches:
    """The searches of all places, kept as that of one is."""
    return _searches_of(places, _Alike(array), airs)


@lru_cache(maxsize=4)
def _searches_of(places: tuple[Place, ...], alike: _Alike, airs: Airs) -> Searches:
    array, pair = alike.array, pair_of(places, alike.array)
    shared = None if pair is None else _cube_search(pair.box, _Alike(pair.array), airs)
    if pair is None or not isinstance(shared, CubeSearch):
        return Searches.of(*(_cube_search(place, alike, airs) for place in places))
    each = tuple(
        replace(shared, ceiling=ceiling(place, array, airs))
        if number in pair.numbers
        else _cube_search(place, alike, airs)
        for number, place in enumerate(places)
    )
    return Searches.with_pair(each, pair, Halves.of(shared.modes, pair.partner, array.count))


@lru_cache(maxsize=16)
def _cube_search(place: Place, alike: _Alike, airs: Airs) -> CubeSearch | PointSearch:
    array = alike.array
    if not place.enforced or place.reach == 0:
        return point_search(place.points, array, airs)
    magnitudes = [np.abs(transfer_matrix(place.points, array, acoustics=air)) for air in airs]
    alone = np.max(magnitudes, axis=(0, 1))
    # Far below what counts as silence there are no modes: single precision has no numbers for them.
    if alone.sum() < 1e-9:
        return point_search(place.points, array, airs)
    wide = _bands(place, array, airs)
    fields = tuple(
        partial(slow_field, place=place, array=array, acoustics=air, magnitude=magnitude)
        for air, magnitude in zip(airs, magnitudes, strict=True)
    )
    where, step, tried = stacks(wide, inside=INSIDE, faces=FACES), NODES, _expected(wide)
    while True:
        heard = heard_by_modes(fields, wide, where, ENOUGH * alone.sum(), step=step, tried=tried)
        # What is left out is 48 dB below all transducers in step.
        if heard.left_out < 4e-3 * alone.sum() or step < 0.7 * NODES:
            return CubeSearch(heard=heard, ceiling=alone)
        step, tried = 0.85 * step, 2 * tried


def _expected(wide: Array) -> int:
    """Somewhat more modes than a field of these bands has: it comes from a surface, so that products of two count."""
    x, y, z = (float(band) for band in wide)
    return round(24 + 0.85 * (x * y + y * z + z * x))


def _bands(place: Place, array: TransducerArray, airs: Airs) -> Array:
    """Those of all airs."""
    return np.max([bands(place, array, air) for air in airs], axis=0)


def ceiling(place: Place, array: TransducerArray, airs: Airs) -> Array:
    """Most that each transducer alone makes at a place in any of the airs, shape (transducer,), in Pa."""
    return np.max([np.abs(transfer_matrix(place.points, array, acoustics=air)) for air in airs], axis=(0, 1))


def point_search(points: Array, array: TransducerArray, airs: Airs) -> PointSearch:
    """The search of some points, shape (point, 3), in m."""
    field = np.concatenate([transfer_matrix(points, array, acoustics=air) for air in airs])
    return PointSearch(modes=field.astype(np.complex64), ceiling=np.abs(field).max(axis=0), airs=len(airs))


def searched_points(place: Place, array: TransducerArray, airs: Airs, *, among: tuple[Place, ...] = ()) -> Array:
    """The points of a place's cube at which a drive is looked at, shape (point, 3), in m.

    Parameters
    ----------
    place, array, airs
        As in `cube_search`: each point is looked at in every air.
    among : tuple of Place
        All that are looked at in one go, itself among them: one that mirrors another has points of both.
    """
    pair = pair_of(among, array)
    if pair is not None and place in (beside := [among[number] for number in pair.numbers]):
        points = searched_points(pair.box, pair.array, airs)
        return points if place == beside[0] else mirrored(points, pair.middle)
    if not place.enforced or place.reach == 0:
        return place.points
    wide = _bands(place, array, airs)
    share = np.concatenate([each.points.reshape(-1, 3) for each in stacks(wide, inside=INSIDE, faces=FACES)])
    return np.array(place.position) + place.reach * share
