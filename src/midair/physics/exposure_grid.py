"""Points of a cube with the spacing at which an array's sound can change, and interpolation between them.

The wave from the middle of the array is factored out of the field. The remainder changes slowly: along each edge of the
cube like waves whose phase changes by at most `bands` from the middle of the cube to its face.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place, combined
from midair.physics.propagation import wavenumber


def lattice(bands: Array, step: float, *, crowd: float = 1.5) -> list[Array]:
    """Coordinates, -1 to 1 at the faces, with at most `step` rad of phase change of the fastest wave between them.

    They are denser at the faces, like Chebyshev nodes, by `crowd` rad, since no points outside constrain the field.
    `bands` (3,) is in rad.
    """
    return [_crowded(float(band), step, crowd) for band in bands]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Points of a cube on planes along one axis, the same points on each plane."""

    axis: int  # Axis perpendicular to the planes
    along: Array  # Coordinates of the planes, shape (plane,), from -1 to 1
    across: Array  # Coordinates of each plane's points along the two other axes, in their order, shape (point, 2)

    @property
    def points(self) -> Array:
        """All points, shape (plane, point, 3)."""
        found = np.empty((len(self.along), len(self.across), 3))
        found[:, :, self.axis] = self.along[:, None]
        found[:, :, [each for each in range(3) if each != self.axis]] = self.across
        return found


def stacks(wide: Array, *, inside: float, faces: float) -> tuple[Stack, Stack, Stack]:
    """Points inside the cube, and denser ones on its faces: on the four along the planes and on the two across.

    `inside` and `faces` are the largest phase changes of the fastest wave between neighbours, `wide` (3,) the `bands`,
    in rad. The planes are perpendicular to the axis along which the field changes most.
    """
    axis = int(wide.argmax())
    one, other = (each for each in range(3) if each != axis)
    wider, closer = lattice(wide, inside), lattice(wide, faces)
    face = combined(closer[one], closer[other])
    return (
        Stack(axis=axis, along=wider[axis][1:-1], across=combined(wider[one][1:-1], wider[other][1:-1])),
        Stack(axis=axis, along=closer[axis][1:-1], across=face[np.abs(face).max(axis=1) == 1]),
        Stack(axis=axis, along=closer[axis][[0, -1]], across=face),
    )


def _crowded(band: float, step: float, crowd: float) -> Array:
    """Coordinates from -1 to 1 with a density of sqrt(band^2 + crowd^2 / (1 - x^2)) / step."""
    turn = np.linspace(0, np.pi, 2001)
    density = np.hypot(band * np.sin(turn), crowd)
    passed = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(turn))])
    gaps = int(np.ceil(passed[-1] / step))
    return -np.cos(np.interp(np.linspace(0, passed[-1], gaps + 1), passed, turn))


def bands(place: Place, array: TransducerArray, acoustics: Acoustics) -> Array:
    """Largest phase change from the middle of the cube to a face, along each axis, shape (3,), in rad.

    For a wave from any transducer, relative to one from the middle of the array.
    """
    turned = _direction(place.points, array.position) - _direction(place.points, middle(array)[None])
    widest = np.abs(turned).max(axis=(0, 1))
    # A single transducer gives a band of 0, but its amplitude changes with distance.
    return np.maximum(wavenumber(array, acoustics.medium) * widest * place.reach, 2.0)


def middle(array: TransducerArray) -> Array:
    """Origin of the wave that is factored out, shape (3,), in m."""
    return array.position.mean(axis=0)


def _direction(points: Array, origin: Array) -> Array:
    away = points[:, None, :] - origin[None, :, :]
    # The direction at the origin itself is undefined; avoid division by 0.
    return away / np.maximum(np.linalg.norm(away, axis=2, keepdims=True), 1e-12)


def between(nodes: Array, at: Array, band: float) -> Array:
    """Interpolation matrix from the nodes to other coordinates along one axis, shape (at, node).

    Least squares for waves up to the band.
    """
    waves = np.linspace(0, band, 3 * len(nodes) + 1)

    def of(where: Array) -> Array:
        phase = np.outer(where, waves)
        return np.concatenate([np.cos(phase), np.sin(phase[:, 1:])], axis=1)

    return np.asarray(of(at) @ np.linalg.pinv(of(nodes), rcond=1e-4), np.float64)


def slow_field(
    share: Array, *, place: Place, array: TransducerArray, acoustics: Acoustics, magnitude: Array
) -> NDArray[np.complex64]:
    """`transfer_matrix` without the wave from the middle, ten times as fast, shape (point, transducer), in Pa.

    `share` (point, 3) are coordinates in the cube, -1 to 1; `magnitude` (27, transducer) is that of the transfer matrix
    at the points of the place, which changes slowly enough to be interpolated.
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
        # Remove whole turns before single precision: hundreds of radians would leave too few digits.
        turns -= np.rint(turns)
        angle = turns.astype(np.float32)
        angle *= np.float32(2 * np.pi)
        np.multiply(strength[part], np.cos(angle), out=field.real[part])
        np.multiply(strength[part], np.sin(angle, out=angle), out=field.imag[part])
    # The magnitude includes a measured response, but not its phase.
    return field if array.alike else field * np.exp(1j * np.angle(array.response)).astype(np.complex64)
