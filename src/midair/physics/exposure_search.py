"""Highest sound anywhere in a cube, for every frame of a drive, from few points at low cost.

Sound from an array reaches a cube from a narrow cone, and the width of the cone limits how fast its magnitude can
change. The search uses a dense lattice on the faces of the cube, outside which nothing constrains the field, and a
wider one inside. `ALLOWANCE` is added for the maximum between points; docs/decisions/0015-exposure-bound.md gives the
remaining error of the worst drive found.

A field from a cone has few degrees of freedom, about 120 in the cube around an ear instead of one for each of 996
transducers. The field is computed in these modes, from there on a few planes, and interpolated between them along the
one edge of the cube, in single precision. The truncation error is measured, and added.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.model import Acoustics, Medium, TransducerArray
from midair.physics.exposure_modes import (
    FieldByModes,
    Product,
    Workspace,
    bands,
    field_by_modes,
    middle,
    power_of,
    slow_field,
    stacks,
)
from midair.physics.exposure_places import Place
from midair.physics.propagation import ArrayKey, transfer_matrix

Complex = NDArray[np.complex64]
Airs = tuple[Acoustics, ...]

ALLOWANCE = 1.15
"""Added to the loudest point of a cube, in dB: about the largest excess between points and airs."""

INSIDE, FACES = 1.6, 1.2
"""Largest phase change of the fastest wave between neighbouring points inside the cube and on its faces, in rad."""

NODES = 1.9
"""Largest phase change between the nodes of the interpolation, in rad."""

ENOUGH = 8e-4
"""Allowed truncation error, relative to the sum of all transducers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaceSearch:
    """Computes the loudest sound of a drive at one place: in a cube, or at a few points if no limit is enforced."""

    field: FieldByModes | None  # From modes to the pressure at the points; None if the modes are these pressures
    modes: Complex  # From the drive to its modes, shape (mode, transducer); without a field they are air x point
    points: Array  # Where the drive is evaluated in every air, shape (point, 3), in m
    ceiling: Array  # Maximum of each transducer alone in Pa, shape (transducer,); the sum bounds all together
    array: TransducerArray
    airs: Airs
    left_out: float = 0.0  # Upper estimate of the truncation error anywhere with every transducer at full drive, in Pa

    @property
    def allowed(self) -> float:
        """Factor for what is between points and airs; none is needed between single points, each of which counts."""
        return 10 ** (ALLOWANCE / 20) if self.field is not None or len(self.airs) > 1 else 1.0

    def loudest(self, modes: Single, space: Workspace) -> Array:
        """Bound of the amplitude, shape (air, frame), in Pa, without `left_out`.

        `modes` is float32 (3, frame, mode): real parts, imaginary parts, and their sums.
        """
        if self.field is not None:
            return self.allowed * self.field.loudest(modes, space).astype(np.float64)
        field = space.array("there", 2, *modes.shape[1:])
        field[:] = modes[:2]
        power = power_of(field).reshape(modes.shape[1], len(self.airs), -1).max(axis=2).T
        return self.allowed * np.sqrt(power).astype(np.float64)

    def at_points(self) -> Complex:
        """From the modes to the pressure at the points in each air, shape (air, point, mode)."""
        if self.field is not None:
            return self.field.at_points()
        return np.eye(len(self.modes), dtype=np.complex64).reshape(len(self.airs), -1, len(self.modes))

    def late(self, points: Array) -> Single:
        """Arrival of each transducer after the first one, (point, transducer), in s to 1 ns, in the middle air."""
        places, position = points.astype(np.float32), self.array.position.astype(np.float32)
        squares = np.square(places).sum(axis=1)[:, None] + np.square(position).sum(axis=1)
        path = np.sqrt(np.abs(squares - 2 * places @ position.T))
        path -= path.min(axis=1, keepdims=True)
        path /= np.float32(self.airs[len(self.airs) // 2].medium.speed)
        return path


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searches:
    """The searches of several places in some airs at once."""

    each: tuple[PlaceSearch, ...]  # The search of each place
    modes: Product  # From the drive to the modes of all places: one large product is faster than many
    ceiling: Array  # Ceilings of all places in Pa, shape (transducer, place)
    left_out: Array  # Truncation errors of all places in Pa, shape (place,)

    @classmethod
    def of(cls, *each: PlaceSearch) -> Self:
        """Searches for one array."""
        return cls(
            each=each,
            modes=Product.of(np.concatenate([one.modes for one in each]).T),
            ceiling=np.stack([one.ceiling for one in each], axis=1),
            left_out=np.array([one.left_out for one in each]),
        )

    def loudest(self, parts: Single, space: Workspace) -> Array:
        """Amplitude at each place in each air, shape (air, frame, place), in Pa, without `left_out`.

        `parts` is float32 (3, frame, transducer), from `drive_parts`.
        """
        frames = parts.shape[1]
        modes = space.array("modes", 3, frames, self.modes.width)
        self.modes.into(modes, parts, space)
        np.add(modes[0], modes[1], out=modes[2])
        own = np.split(modes, np.cumsum([len(each.modes) for each in self.each])[:-1], axis=2)
        return np.stack([each.loudest(its, space) for each, its in zip(self.each, own, strict=True)], axis=2)

    def bounded(self, found: Array, level: Array) -> Array:
        """Amplitudes of `loudest` (frame, place) with `left_out`, in Pa; `level` as in `drive_parts`, (frame,)."""
        return np.minimum(found + level[:, None] * self.left_out, level[:, None] * self.ceiling.sum(axis=0))


def searches_of(places: tuple[Place, ...], array: TransducerArray, airs: Airs) -> Searches:
    """The searches of all places: the whole cube if the limit is enforced, otherwise its 27 points.

    Cached, since the exposure of a drive is computed in parts, more than once, and for many drives.
    """
    return _searches_of(places, ArrayKey(array), airs)


@lru_cache(maxsize=4)
def _searches_of(places: tuple[Place, ...], key: ArrayKey, airs: Airs) -> Searches:
    return Searches.of(*(_cube_search(place, key, airs) for place in places))


@lru_cache(maxsize=16)
def _cube_search(place: Place, key: ArrayKey, airs: Airs) -> PlaceSearch:
    array = key.array
    if not place.enforced or place.reach == 0:
        return point_search(place.points, array, airs)
    magnitudes = [np.abs(transfer_matrix(place.points, array, acoustics=air)) for air in airs]
    alone = np.max(magnitudes, axis=(0, 1))
    # Far below silence there are no modes, since single precision would underflow.
    if alone.sum() < 1e-9:
        return point_search(place.points, array, airs)
    wide = bands(place, array, min(airs, key=lambda air: air.medium.speed))
    fields = tuple(
        partial(slow_field, place=place, array=array, acoustics=air, magnitude=magnitude)
        for air, magnitude in zip(airs, magnitudes, strict=True)
    )
    # The number of modes is estimated from products of two bands, since the sources form a surface.
    x, y, z = (float(band) for band in wide)
    where, step, tried = stacks(wide, inside=INSIDE, faces=FACES), NODES, round(24 + 0.85 * (x * y + y * z + z * x))
    while True:
        field = field_by_modes(fields, wide, where, ENOUGH * alone.sum(), step=step, tried=tried)
        # The truncation error is 48 dB below the sum of all transducers.
        if field.left_out < 4e-3 * alone.sum() or step < 0.7 * NODES:
            share = np.concatenate([each.points.reshape(-1, 3) for each in where])
            points, left_out = np.array(place.position) + place.reach * share, field.left_out
            known: dict[str, Any] = {"ceiling": alone, "array": array, "airs": airs, "left_out": left_out}
            return PlaceSearch(field=field, modes=field.modes, points=points, **known)
        step, tried = 0.85 * step, 2 * tried


def ceiling(place: Place, array: TransducerArray, airs: Airs) -> Array:
    """Maximum of each transducer alone at a place in any of the airs, shape (transducer,), in Pa."""
    return np.max([np.abs(transfer_matrix(place.points, array, acoustics=air)) for air in airs], axis=(0, 1))


def point_search(points: Array, array: TransducerArray, airs: Airs) -> PlaceSearch:
    """The search of some points, shape (point, 3), in m."""
    field = np.concatenate([transfer_matrix(points, array, acoustics=air) for air in airs])
    most, modes = np.abs(field).max(axis=0), field.astype(np.complex64)
    return PlaceSearch(field=None, modes=modes, points=points, ceiling=most, array=array, airs=airs)


UNKNOWN = (14.0, 30.0)
"""Temperature range in degrees Celsius if no temperature is stated; 14 is the paper's 340 m/s."""

AROUND = 2.0
"""Maximum deviation of the room from its stated temperature, in degrees Celsius."""

HUMID = 0.2
"""Maximum deviation of the relative humidity from the stated one, 0 to 1."""

ANY_HUMIDITY = (0.1, 0.9)
"""Range of the relative humidity if none is stated, 0 to 1."""

STEP = 2.6
"""Largest change of phase over the array from one air to the next, in rad."""


def airs_of_room(room: Medium | None, places: tuple[Place, ...], array: TransducerArray) -> tuple[Acoustics, ...]:
    """The airs that a room may have, from the coldest to the warmest.

    They are 2 degrees and 20 % of humidity around the stated air; 14 to 30 degrees if `room` is None. A humidity of 50
    % is that of `Medium.at` by default, and counts as not stated: 10 to 90 %.
    """
    cold, warm = UNKNOWN if room is None else (max(room.degrees - AROUND, 0.0), min(room.degrees + AROUND, 50.0))
    humidity = 0.5 if room is None or room.humidity is None else room.humidity
    dry, damp = ANY_HUMIDITY if humidity == 0.5 else (max(humidity - HUMID, 0.0), min(humidity + HUMID, 1.0))
    # An attenuation that was measured, or computed for another air pressure, counts where it is lower.
    most = np.inf if room is None else room.attenuation
    slow, fast = (Medium.at(temperature=t, humidity=wet).speed for t, wet in ((cold, dry), (warm, damp)))
    turns = 2 * np.pi * array.frequency * (1 / slow - 1 / fast)
    # The paths from the transducers to a place differ from that from the middle of the array by this much, in m.
    points = np.concatenate([place.points for place in places])
    paths = np.linalg.norm(points[:, None] - array.position, axis=2)
    longest = float(np.abs(paths - np.linalg.norm(points - middle(array), axis=1)[:, None]).max())
    count = 1 + max(2, int(np.ceil(turns * longest / STEP)))
    return tuple(
        Acoustics(medium=_air(float(degrees), float(wet), (dry, damp), most, array.frequency))
        for degrees, wet in zip(np.linspace(cold, warm, count), np.linspace(dry, damp, count), strict=True)
    )


def _air(degrees: float, humidity: float, ends: tuple[float, float], most: float, frequency: float) -> Medium:
    """Air with the lowest attenuation between two humidities, where it has no minimum, and at most `most` Np/m."""
    airs = [Medium.at(temperature=degrees, humidity=each, frequency=frequency) for each in (humidity, *ends)]
    return replace(airs[0], attenuation=min(most, *(air.attenuation for air in airs)))
