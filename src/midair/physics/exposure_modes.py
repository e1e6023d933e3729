"""The field at many points of a cube from few numbers: modes of the array, shapes on a few planes, points.

The points have the spacing at which an array's sound can change, and the field is interpolated between them. The wave
from the middle of the array is factored out of the field. The remainder changes slowly: along each edge of the cube
like waves whose phase changes by at most `bands` from the middle of the cube to its face.

Frames of a drive and their products with a field are in single precision, written into reused arrays.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.model import Acoustics, Drive, TransducerArray
from midair.physics.exposure_places import Place, combined, small_angle
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
    # Points of a lattice share coordinates: squares of their distances along each axis, and the row of each point.
    axes = [np.unique(along, return_inverse=True) for along in points.T]
    away = (np.subtract.outer(at, array.position[:, axis]) for axis, (at, _) in enumerate(axes))
    (x, y, z), (i, j, k) = (np.square(each.astype(np.float32)) for each in away), (row for _, row in axes)
    for first in range(0, len(points), 32):
        part = slice(first, first + 32)
        path = x[i[part]]
        path += y[j[part]]
        path += z[k[part]]
        turns = np.sqrt(path, out=path)
        turns -= own[part, None]
        turns *= turns_per_metre
        # Lengths in single precision leave 1e-4 rad; sines need the rest of a turn.
        turns -= np.rint(turns)
        angle = np.multiply(turns, np.float32(2 * np.pi), out=turns)
        np.multiply(strength[part], np.cos(angle), out=field.real[part])
        np.multiply(strength[part], np.sin(angle, out=angle), out=field.imag[part])
    # The magnitude includes a measured response, but not its phase.
    return field if array.alike else field * np.exp(1j * np.angle(array.response)).astype(np.complex64)


class Workspace:
    """Named arrays that are reused, for one thread.

    Allocating new ones for each block of frames would take as long as the computation, because the system clears new
    pages.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Single] = {}

    def array(self, name: str, *shape: int) -> Single:
        """The array of that name, with undefined content."""
        size, held = prod(shape), self._kept.get(name)
        if held is None or held.size < size:
            held = self._kept[name] = np.empty(size, np.float32)
        return held[:size].reshape(shape)


TOO_FEW = 8
"""Frames up to which two products of all parts are faster than three."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Product:
    """Multiplication by a complex matrix with three real products instead of four (Gauss).

    Few frames need the time in which the matrix is read, so that they are multiplied by its two parts.
    """

    real: Single  # Real part of the matrix, shape (in, out)
    imaginary: Single  # Imaginary part
    less: Single  # Imaginary minus real part
    more: Single  # Imaginary plus real part

    @classmethod
    def of(cls, matrix: NDArray[np.complexfloating]) -> Self:
        """Make it from a matrix of shape (in, out)."""
        real, imaginary = matrix.real, matrix.imag
        parts = {"real": real, "imaginary": imaginary, "less": imaginary - real, "more": imaginary + real}
        return cls(**{name: np.ascontiguousarray(each, np.float32) for name, each in parts.items()})

    @property
    def width(self) -> int:
        """Number of outputs."""
        return self.real.shape[1]

    def into(self, found: Single, parts: Single, space: Workspace) -> None:
        """Write real and imaginary part of the product into `found`, float32 (2 or more, frame, out).

        `parts` is float32 (3, frame, in): real parts, imaginary parts, and their sums.
        """
        real, imaginary, both = parts
        if (count := len(both)) <= TOO_FEW:
            two = parts[:2].reshape(2 * count, -1)
            by_real, by_imaginary = two @ self.real, two @ self.imaginary
            np.subtract(by_real[:count], by_imaginary[count:], out=found[0])
            np.add(by_imaginary[:count], by_real[count:], out=found[1])
            return
        shared = np.matmul(both, self.real, out=space.array("shared", count, self.width))
        np.matmul(imaginary, self.more, out=found[0])
        np.subtract(shared, found[0], out=found[0])
        np.matmul(real, self.less, out=found[1])
        np.add(shared, found[1], out=found[1])


def power_of(field: Single) -> Single:
    """Squared magnitude, shape (frame, point), of (real and imaginary, frame, point), which is overwritten."""
    np.multiply(field, field, out=field)
    return np.add(field[0], field[1], out=field[0])


def drive_parts(
    drive: Drive, frames: slice | NDArray[np.intp], space: Workspace, *, steps: int | None = None
) -> tuple[Single, Array]:
    """Some frames as float32 (3, frame, transducer), and the highest level of each, shape (frame,).

    `steps` rounds phases to that many steps per turn.
    """
    phase = np.asarray(drive.phase[frames])
    level = np.asarray(drive.level[frames]).reshape(len(phase), -1)
    parts, angle = space.array("parts", 3, *phase.shape), space.array("angle", *phase.shape)
    small_angle(phase, angle)
    if steps is not None:
        angle *= steps / (2 * np.pi)
        np.rint(angle, out=angle)
        angle *= 2 * np.pi / steps
    np.cos(angle, out=parts[0])
    np.sin(angle, out=parts[1])
    parts[:2] *= level.astype(np.float32)
    np.add(parts[0], parts[1], out=parts[2])
    return parts, level.max(axis=1)


Complex = NDArray[np.complex64]
Field = Callable[[Array], Complex]


FEW = 64
"""Frames whose points are computed at once, so that they stay in the cache."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Points on planes through the cube: all combinations of places across and along."""

    planes: slice  # The planes from which the field follows
    across: Single  # From shapes on a plane to the pressure at its points, in Pa, shape (shape, point of a plane)
    # From the planes to other planes, shape (point, plane); None if the planes themselves are searched
    along: Single | None

    def field(self, shaped: Single, space: Workspace) -> Single:
        """Pressure in Pa, shape (parts, frame, point), of shapes (parts, frame, plane, shape)."""
        kept = shaped[:, :, self.planes]
        two, frames, planes, shapes = kept.shape
        points = self.across.shape[1]
        field = space.array("on the planes", two, frames, planes, points)
        # Part by part, since both together would need a copy.
        for part, found in zip(kept, field, strict=True):
            np.matmul(part.reshape(-1, shapes), self.across, out=found.reshape(-1, points))
        if self.along is not None:
            field = np.matmul(self.along, field, out=space.array("there", two, frames, len(self.along), points))
        return field.reshape(two, frames, -1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldByModes:
    """The field at the points of a cube, computed from modes."""

    modes: Complex  # From the transducers to the modes of their field in the cube, shape (mode, transducer)
    shapes: Product  # From the modes to shapes of the field on some planes, (mode, air x plane x shape)
    airs: int  # Number of airs
    planes: int  # Number of planes
    points: tuple[Points, ...]
    left_out: float  # Upper estimate of the truncation error anywhere with every transducer at full drive, in Pa

    def loudest(self, modes: Single, space: Workspace) -> Single:
        """Magnitude at the loudest point in each air, shape (air, frame), in Pa, of modes as in `CubeSearch`."""
        shaped = space.array("shapes", 2, modes.shape[1], self.shapes.width)
        self.shapes.into(shaped, modes, space)
        # Each air of each frame counts like a frame of its own.
        planes = shaped.reshape(2, modes.shape[1] * self.airs, self.planes, -1)
        power = np.empty(planes.shape[1], np.float32)
        for first in range(0, len(power), FEW):
            few = slice(first, first + FEW)
            power[few] = np.max(
                [power_of(each.field(planes[:, few], space)).max(axis=1) for each in self.points], axis=0
            )
        return np.sqrt(power).reshape(-1, self.airs).T

    def at_points(self) -> Complex:
        """From the modes to the pressure at the points in each air, shape (air, point, mode)."""
        count, space = len(self.modes), Workspace()
        alone = np.stack([np.eye(count), np.zeros((count, count)), np.eye(count)]).astype(np.float32)
        shaped = np.empty((2, count, self.shapes.width), np.float32)
        self.shapes.into(shaped, alone, space)
        planes = shaped.reshape(2, count * self.airs, self.planes, -1)
        real, imaginary = np.concatenate([each.field(planes, space).copy() for each in self.points], axis=2)
        return (real + 1j * imaginary).astype(np.complex64).reshape(count, self.airs, -1).transpose(1, 2, 0)


def field_by_modes(
    fields: tuple[Field, ...], wide: Array, stacks: tuple[Stack, ...], enough: float, *, step: float, tried: int
) -> FieldByModes:
    """Compute the modes of the field at some nodes, and the interpolation between the nodes.

    `fields` return the field of each transducer in each air (point, transducer) at points of the cube, without the fast
    wave; `wide` (3,) are the `bands` in rad; `enough` is about the allowed truncation error in Pa; `step` the spacing
    of the nodes in rad; `tried` the maximum number of modes.
    """
    nodes, axis = lattice(wide, step, crowd=2.0), stacks[0].axis
    # All airs share the same modes: the field in one air is that of a slightly different place in another.
    waves, modes = modes_of(np.concatenate([field(combined(*nodes)) for field in fields]), tried, enough)
    # The planes are perpendicular to the axis along which the field changes most.
    planes = np.moveaxis(waves.reshape(len(fields), *map(len, nodes), -1), axis + 1, 1)
    count = planes.shape[1]
    planes = planes.reshape(len(fields) * count, -1, waves.shape[1])
    few = _shapes(planes * np.linalg.norm(modes, axis=1), 0.4 * enough / np.sqrt(modes.shape[1]))
    to_planes = (few.T.astype(np.float32) @ planes).reshape(len(fields), count, few.shape[1], -1)
    interpolations = [_interpolation(each, nodes, wide, few) for each in stacks]
    rest = []
    for field, own in zip(fields, to_planes, strict=True):
        tests = [
            _test_points(each, interpolation, own) for each, interpolation in zip(stacks, interpolations, strict=True)
        ]
        share, made = (np.concatenate(each) for each in zip(*tests, strict=True))
        rest.append(float(np.abs(field(share) - made @ modes).sum(axis=1).max()))
    return FieldByModes(
        modes=modes,
        shapes=Product.of(to_planes.reshape(-1, to_planes.shape[3]).T),
        airs=len(fields),
        planes=count,
        points=tuple(_points(*interpolation) for interpolation in interpolations),
        # A quarter more than at the test points.
        left_out=1.25 * max(rest),
    )


def _interpolation(stack: Stack, axes: list[Array], wide: Array, few: Array) -> tuple[Array, Array]:
    """From the nodes' planes to those of a stack, and from the shapes on a plane to its points."""
    one, other = (each for each in range(3) if each != stack.axis)
    along = between(axes[stack.axis], stack.along, float(wide[stack.axis]))
    y = between(axes[one], stack.across[:, 0], float(wide[one]))
    z = between(axes[other], stack.across[:, 1], float(wide[other]))
    return along, np.einsum("py,pz->pyz", y, z).reshape(len(y), -1) @ few


def _points(along: Array, across: Array) -> Points:
    # The first and last plane are planes of the nodes and need no interpolation.
    own = len(along) == 2
    return Points(
        planes=slice(None, None, along.shape[1] - 1) if own else slice(None),
        across=np.ascontiguousarray(across.T, np.float32),
        along=None if own else along.astype(np.float32),
    )


def _test_points(stack: Stack, interpolation: tuple[Array, Array], to_planes: Complex) -> tuple[Array, Complex]:
    """Some points of a stack, its corners included, and the matrix from the modes to the field there."""
    along, across = interpolation
    edge = np.abs(stack.points).sum(axis=2).ravel()
    # A fixed seed, so that results are reproducible.
    some = np.union1d(np.flatnonzero(edge > edge.max() - 1e-9), np.random.default_rng(0).permutation(edge.size)[:56])
    plane, point = np.unravel_index(some, stack.points.shape[:2])
    weights = np.einsum("tp,ts->tps", along[plane], across[point]).reshape(len(some), -1)
    return stack.points[plane, point], weights.astype(np.float32) @ to_planes.reshape(-1, to_planes.shape[2])


def _shapes(planes: Complex, enough: float) -> Array:
    """Real patterns whose sums reproduce the field on each plane to the mean error `enough`, shape (point, pattern)."""
    parts = np.concatenate([planes.real, planes.imag], axis=2).transpose(1, 0, 2).reshape(planes.shape[1], -1)
    power, vectors = np.linalg.eigh((parts @ parts.T).astype(np.float64))
    rest = np.cumsum(np.maximum(power, 0)) / (planes.shape[0] * planes.shape[1])
    return np.asarray(vectors[:, rest > enough**2], np.float64)


def modes_of(field: Complex, tried: int, enough: float) -> tuple[Complex, Complex]:
    """Shapes and modes whose product is the field except for less than `enough`, (point, mode) and (mode, transducer).

    From `tried` random drives (Halko, Martinsson & Tropp 2011, SIAM Review 53, 217, section 4.1), or from all columns.
    """
    found, whole = field, tried >= field.shape[1]
    if not whole:
        # A fixed seed, so that results are reproducible. Real drives need two products instead of four.
        drives = np.random.default_rng(0).standard_normal((field.shape[1], min(tried, len(field))), dtype=np.float32)
        found = field.real @ drives + 1j * (field.imag @ drives)
    # Double precision, since weak modes would be lost in the squares.
    power, vectors = np.linalg.eigh((found := found.astype(np.complex128)).conj().T @ found)
    size = np.sqrt(np.maximum(power, 1e-14 * power[-1]))
    shapes = (found @ (vectors / size)).astype(np.complex64)
    if whole:
        shapes, modes = shapes[:, ::-1], (size * vectors).T[::-1].conj().astype(np.complex64)
    else:
        modes = shapes.conj().T @ field
        # Rotate to modes in order of strength.
        _, vectors = np.linalg.eigh((modes @ modes.conj().T).astype(np.complex128))
        turn = vectors[:, ::-1].astype(np.complex64)
        shapes, modes = np.asarray(shapes @ turn, np.complex64), np.asarray(turn.conj().T @ modes, np.complex64)
    # No drive at full level can excite a mode by more than sqrt(count) times its norm.
    rest = np.abs(shapes) ** 2 * (np.abs(modes) ** 2).sum(axis=1) * field.shape[1]
    after = np.sqrt(np.cumsum(rest[:, ::-1], axis=1)[:, ::-1].max(axis=0))
    count = int((after > 1.2 * enough).sum())
    return shapes[:, :count], modes[:count]
