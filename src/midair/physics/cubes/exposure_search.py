"""The loudest sound anywhere in a cube, for every frame of a drive, from few points and at little cost.

Sound from an array comes to a cube from a narrow cone, so that its magnitude cannot change faster than the width of
that cone lets it. It is looked at on lattices, a close one on the faces of the cube, behind which nothing holds it, and
a wider one inside. A finite number of points still misses something; `ALLOWANCE` is put on for that, and
docs/decisions/0015-exposure-bound.md says how much the best of all drives can hide all the same.

A field that comes from a cone has few degrees of freedom, about 120 in the cube around an ear instead of one for each
of 996 transducers. The field is worked out in these modes, from there on a few planes, and between them along the one
edge of the cube, in single precision. What all that leaves out is measured, and added.
"""

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.cubes.exposure_grid import bands, slow_field, stacks
from midair.physics.cubes.exposure_modes import FieldByModes, heard_by_modes
from midair.physics.cubes.exposure_products import Product, Workspace, loudest_of
from midair.physics.exposure_places import Place
from midair.physics.propagation import transfer_matrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex64]

ALLOWANCE = 1.15
"""Put on the loudest point of a cube, in dB: between the points it can be this much louder, and a little more."""

INSIDE, FACES = 1.6, 1.0
"""By how much the phase of the quickest wave may change from a point to the next, in rad."""

NODES = 1.9
"""The same between points from which the field everywhere else in the cube follows, in rad."""

ENOUGH = 1e-3
"""Of all transducers in step: about as much as the modes may leave out."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointSearch:
    """The loudest of a few points, of a place that only advises.

    Attributes
    ----------
    modes : ndarray of complex, shape (point, transducer)
        From the drive to the pressure at the points, in Pa.
    ceiling : ndarray, shape (transducer,)
        Most that each transducer alone makes there, in Pa; all together cannot make more than the sum.
    left_out : float
        As that of `CubeSearch`: nothing.
    """

    modes: Complex
    ceiling: Array
    left_out: float = 0.0

    def loudest(self, modes: Single, space: Workspace) -> Array:
        """As that of `CubeSearch`, of the points alone."""
        there = space.array("there", 2, *modes.shape[1:])
        there[:] = modes[:2]
        return loudest_of(there).astype(np.float64)


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
    def left_out(self) -> float:
        """Most that the modes leave out anywhere when every transducer is at full drive, in Pa."""
        return self.heard.left_out

    def loudest(self, modes: Single, space: Workspace) -> Array:
        """Amplitude that no place in the cube exceeds but by what the docs say, shape (frame,), in Pa.

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
    """The searches of several places in one air, in one go.

    Attributes
    ----------
    each : tuple of CubeSearch or PointSearch
        Of each place.
    modes : Product
        From the drive to the modes of all of them, one after the other: one large product takes less than many.
    """

    each: tuple[CubeSearch | PointSearch, ...]
    modes: Product

    @classmethod
    def of(cls, *each: CubeSearch | PointSearch) -> Self:
        """Of one array."""
        return cls(each=each, modes=Product.of(np.concatenate([one.modes for one in each]).T))

    def loudest(self, parts: Single, space: Workspace) -> Array:
        """Amplitude at each place, shape (frame, place), in Pa, but for what is left out.

        Parameters
        ----------
        parts : ndarray of float32, shape (3, frame, transducer)
            Real parts of the drive, its imaginary parts, and the sums of both.
        space : Workspace
            Of the thread that asks.
        """
        modes = space.array("modes", 3, parts.shape[1], self.modes.width)
        self.modes.into(modes, parts, space)
        np.add(modes[0], modes[1], out=modes[2])
        own = np.split(modes, np.cumsum([len(one.modes) for one in self.each])[:-1], axis=2)
        return np.stack([one.loudest(its, space) for one, its in zip(self.each, own, strict=True)], axis=1)


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


def cube_search(place: Place, array: TransducerArray, acoustics: Acoustics) -> CubeSearch | PointSearch:
    """The search of a place: all of its cube where the limit is enforced, its 27 points where it only advises.

    Kept, since a drive is measured in parts, more than once, and one drive after the other.
    """
    return _cube_search(place, _Alike(array), acoustics)


def searches_of(places: tuple[Place, ...], array: TransducerArray, acoustics: Acoustics) -> Searches:
    """The searches of all places, kept as that of one is."""
    return _searches_of(places, _Alike(array), acoustics)


@lru_cache(maxsize=4)
def _searches_of(places: tuple[Place, ...], alike: _Alike, acoustics: Acoustics) -> Searches:
    return Searches.of(*(_cube_search(place, alike, acoustics) for place in places))


@lru_cache(maxsize=16)
def _cube_search(place: Place, alike: _Alike, acoustics: Acoustics) -> CubeSearch | PointSearch:
    array = alike.array
    if not place.enforced or place.reach == 0:
        return point_search(place.points, array, acoustics)
    magnitude = np.abs(transfer_matrix(place.points, array, acoustics=acoustics))
    ceiling = magnitude.max(axis=0)
    # Far below what counts as silence there are no modes: single precision has no numbers for them.
    if ceiling.sum() < 1e-9:
        return point_search(place.points, array, acoustics)
    wide = bands(place, array, acoustics)
    field = partial(slow_field, place=place, array=array, acoustics=acoustics, magnitude=magnitude)
    where, step, tried = stacks(wide, inside=INSIDE, faces=FACES), NODES, 160
    while True:
        # What is left out is 48 dB below all transducers in step.
        heard = heard_by_modes(field, wide, where, ENOUGH * ceiling.sum(), step=step, tried=tried)
        if heard.left_out < 4e-3 * ceiling.sum() or step < 0.7 * NODES:
            return CubeSearch(heard=heard, ceiling=ceiling)
        step, tried = 0.85 * step, 2 * tried


def point_search(points: Array, array: TransducerArray, acoustics: Acoustics) -> PointSearch:
    """The search of some points, shape (point, 3), in m."""
    field = transfer_matrix(points, array, acoustics=acoustics)
    return PointSearch(modes=field.astype(np.complex64), ceiling=np.abs(field).max(axis=0))


def searched_points(place: Place, array: TransducerArray, acoustics: Acoustics) -> Array:
    """The points of a place's cube at which a drive is looked at, shape (point, 3), in m."""
    if not place.enforced or place.reach == 0:
        return place.points
    wide = bands(place, array, acoustics)
    share = np.concatenate([each.points.reshape(-1, 3) for each in stacks(wide, inside=INSIDE, faces=FACES)])
    return np.array(place.position) + place.reach * share
