"""Points of a cube as close together as the sound of an array can change there, and the sound between them.

A wave is taken out of the field that comes from the middle of the array. What is left changes slowly: along each edge
of the cube like waves whose phase changes by no more than `bands` from the middle of the cube to its face.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.propagation import wavenumber

Array = NDArray[np.float64]
Single = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lattice:
    """Points on planes through a cube, its faces among them: all combinations of three coordinates.

    Attributes
    ----------
    axes : tuple of three ndarrays
        Coordinates, from -1 to 1 at the faces.
    """

    axes: tuple[Array, Array, Array]

    @property
    def points(self) -> Array:
        """All of them, shape (point, 3), the last coordinate changing fastest."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, 3)

    @property
    def shape(self) -> tuple[int, int, int]:
        """How many there are along each axis."""
        x, y, z = (len(each) for each in self.axes)
        return x, y, z


def lattice(bands: Array, step: float, *, crowd: float = 1.5) -> Lattice:
    """Points of which two neighbours are no further apart than the phase of the quickest wave changes by a step.

    Next to the faces they crowd, as those of Chebyshev do: beyond a face nothing holds the field.

    Parameters
    ----------
    bands : ndarray, shape (3,)
        From `bands`, in rad.
    step : float
        In rad.
    crowd : float
        How much, in rad.
    """
    x, y, z = (_crowded(float(band), step, crowd) for band in bands)
    return Lattice(axes=(x, y, z))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Points of a cube on planes that follow each other along one axis, the same on each plane.

    Attributes
    ----------
    axis : int
        Along which the planes follow.
    along : ndarray, shape (plane,)
        Where, from -1 to 1.
    across : ndarray, shape (point, 2)
        Points of each plane: their coordinates along the two other axes, in their order.
    """

    axis: int
    along: Array
    across: Array

    @property
    def points(self) -> Array:
        """All of them, shape (plane, point, 3)."""
        found = np.empty((len(self.along), len(self.across), 3))
        found[:, :, self.axis] = self.along[:, None]
        found[:, :, [each for each in range(3) if each != self.axis]] = self.across
        return found


def stacks(wide: Array, *, inside: float, faces: float) -> tuple[Stack, Stack, Stack]:
    """Points inside the cube, and closer ones on its faces: on the four along the planes and on the two across.

    Parameters
    ----------
    wide : ndarray, shape (3,)
        From `bands`, in rad. The planes lie across the axis along which the field changes most.
    inside, faces : float
        By how much the phase of the quickest wave may change from a point to the next, in rad.
    """
    axis = int(wide.argmax())
    one, other = (each for each in range(3) if each != axis)
    wider, closer = lattice(wide, inside).axes, lattice(wide, faces).axes
    face = _pairs(closer[one], closer[other])
    return (
        Stack(axis=axis, along=wider[axis][1:-1], across=_pairs(wider[one][1:-1], wider[other][1:-1])),
        Stack(axis=axis, along=closer[axis][1:-1], across=face[np.abs(face).max(axis=1) == 1]),
        Stack(axis=axis, along=closer[axis][[0, -1]], across=face),
    )


def _pairs(one: Array, other: Array) -> Array:
    return np.stack(np.meshgrid(one, other, indexing="ij"), axis=-1).reshape(-1, 2)


def _crowded(band: float, step: float, crowd: float) -> Array:
    """From -1 to 1, with a density of sqrt(band^2 + crowd^2 / (1 - x^2)) / step."""
    turn = np.linspace(0, np.pi, 2001)
    density = np.hypot(band * np.sin(turn), crowd)
    passed = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(turn))])
    gaps = int(np.ceil(passed[-1] / step))
    return -np.cos(np.interp(np.linspace(0, passed[-1], gaps + 1), passed, turn))


def bands(place: Place, array: TransducerArray, acoustics: Acoustics) -> Array:
    """By how much a phase changes at most from the middle of the cube to a face, along each axis, shape (3,), in rad.

    Of a wave from any transducer, beside one from the middle of the array.
    """
    turned = _direction(place.points, array.position) - _direction(place.points, middle(array)[None])
    widest = np.abs(turned).max(axis=(0, 1))
    # Waves of a single transducer have no width, but grow weaker with distance.
    return np.maximum(wavenumber(array, acoustics.medium) * widest * place.reach, 2.0)


def middle(array: TransducerArray) -> Array:
    """Where the wave begins that is taken out, shape (3,), in m."""
    return array.position.mean(axis=0)


def _direction(points: Array, origin: Array) -> Array:
    away = points[:, None, :] - origin[None, :, :]
    # At an origin there is no direction, and no length to divide by.
    return away / np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-12)


def between(nodes: Array, at: Array, band: float) -> Array:
    """What the field at some coordinates is of that at the nodes, along one axis, shape (at, node).

    The least squares of waves up to the band.
    """
    waves = np.linspace(0, band, 3 * len(nodes) + 1)

    def of(where: Array) -> Array:
        phase = np.outer(where, waves)
        return np.concatenate([np.cos(phase), np.sin(phase[:, 1:])], axis=1)

    return np.asarray(of(at) @ np.linalg.pinv(of(nodes), rcond=1e-4), np.float64)


def slow_field(
    share: Array, *, place: Place, array: TransducerArray, acoustics: Acoustics, magnitude: Array
) -> NDArray[np.complex64]:
    """`transfer_matrix` without the wave from the middle, in a tenth of its time, shape (point, transducer), in Pa.

    Parameters
    ----------
    share : ndarray, shape (point, 3)
        Points of the cube, from -1 to 1.
    place, array, acoustics
        As in `cube_search`.
    magnitude : ndarray, shape (27, transducer)
        That of the transfer matrix at the points of the place: it changes slowly, so that they are enough.
    """
    points = np.array(place.position) + place.reach * share
    x, y, z = (np.stack([(s - 1) * s / 2, 1 - s * s, (s + 1) * s / 2], axis=1) for s in share.T)
    weights = np.einsum("ma,mb,mc->mabc", x, y, z).reshape(len(points), 27)
    strength = weights.astype(np.float32) @ magnitude.astype(np.float32)
    field = np.empty((len(points), array.count), np.complex64)
    turns_per_metre = wavenumber(array, acoustics.medium) / (2 * np.pi)
    own = np.linalg.norm(points - middle(array), axis=1)
    for first in range(0, len(points), 32):
        part = slice(first, first + 32)
        path = np.zeros((len(points[part]), array.count))
        for axis in range(3):
            away = np.subtract.outer(points[part, axis], array.position[:, axis])
            path += np.multiply(away, away, out=away)
        turns = np.sqrt(path, out=path)
        turns -= own[part, None]
        turns *= turns_per_metre
        # Whole turns go before single precision: hundreds of radians would leave too few digits.
        turns -= np.rint(turns)
        angle = turns.astype(np.float32)
        angle *= np.float32(2 * np.pi)
        np.multiply(strength[part], np.cos(angle), out=field.real[part])
        np.multiply(strength[part], np.sin(angle, out=angle), out=field.imag[part])
    # The strength has the size of what was measured, and not yet by how much each transducer is ahead.
    return field if array.alike else field * np.exp(1j * np.angle(array.response)).astype(np.complex64)
