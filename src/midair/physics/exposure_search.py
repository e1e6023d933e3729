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
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_grid import Lattice, bands, between, lattice, slow_field
from midair.physics.exposure_places import Place
from midair.physics.propagation import transfer_matrix

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Modes = tuple[NDArray[np.complex64], NDArray[np.complex64]]

ALLOWANCE = 1.15
"""Put on the loudest point of a cube, in dB: between the points it can be this much louder, and a little more."""

INSIDE, FACES = 1.6, 1.0
"""By how much the phase of the quickest wave may change from a point to the next, in rad."""

NODES = 1.9
"""The same between points from which the field everywhere else in the cube follows, in rad."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointSearch:
    """The loudest of a few points, of a place that only advises.

    Attributes
    ----------
    field : ndarray of float32, shape (2 transducer, 2 point)
        From real, then imaginary parts of the drive to those of the pressure, in Pa.
    ceiling : ndarray, shape (transducer,)
        Most that each transducer alone makes there, in Pa; all together cannot make more than the sum.
    left_out : float
        As that of `CubeSearch`: nothing.
    """

    field: Single
    ceiling: Array
    left_out: float = 0.0

    def loudest(self, parts: Single) -> Array:
        """As that of `CubeSearch`, of the points alone."""
        return _magnitude((parts @ self.field).reshape(len(parts), 2, -1)).astype(np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Some points of the cube: all at some places across the planes, times all at some places along them.

    Attributes
    ----------
    planes : slice
        From which planes the field there follows.
    across : ndarray of float32, shape (shape, point of a plane)
        From shapes on a plane to the pressure there, in Pa.
    along : ndarray of float32, shape (point, plane), or None
        From the planes to others; None where it is the planes themselves that count.
    """

    planes: slice
    across: Single
    along: Single | None

    def loudest(self, shapes: Single) -> Single:
        """Magnitude at the loudest point, shape (frame,), in Pa, of shapes (frame, parts, plane, shape)."""
        kept = shapes[:, :, self.planes]
        there = (kept.reshape(-1, len(self.across)) @ self.across).reshape(*kept.shape[:3], -1)
        return _magnitude(there if self.along is None else self.along @ there)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CubeSearch:
    """How the loudest sound in the cube of one place follows from what the transducers are told.

    Attributes
    ----------
    modes : tuple of three ndarrays of float32, shape (transducer, mode)
        From the drive to the modes: real parts, imaginary less real parts, and their sum.
    shapes : ndarray of float32, shape (2 mode, 2 plane x shape)
        From real, then imaginary parts of the modes to those of shapes of the field on some planes.
    planes : int
        How many.
    points : tuple of Points
        Where the field is looked at.
    left_out : float
        Most that all this leaves out anywhere when every transducer is at full drive, in Pa.
    ceiling : ndarray, shape (transducer,)
        As that of `PointSearch`, of all of the cube.
    """

    modes: tuple[Single, Single, Single]
    shapes: Single
    planes: int
    points: tuple[Points, ...]
    left_out: float
    ceiling: Array

    def loudest(self, parts: Single) -> Array:
        """Amplitude that no place in the cube exceeds but by what the docs say, shape (frame,), in Pa.

        What is left out is to be added.

        Parameters
        ----------
        parts : ndarray of float32, shape (frame, 2 transducer)
            Real parts of the drive, then its imaginary parts.
        """
        shapes = (self._heard(parts) @ self.shapes).reshape(len(parts), 2, self.planes, -1)
        # Few frames at a time stay in the cache.
        few = [shapes[first : first + 32] for first in range(0, len(shapes), 32)]
        found = np.concatenate([np.max([each.loudest(some) for each in self.points], axis=0) for some in few])
        return 10 ** (ALLOWANCE / 20) * found

    def _heard(self, parts: Single) -> Single:
        """Real and imaginary parts of the modes, by three products of real matrices in place of four (Gauss)."""
        real, imaginary = np.split(parts, 2, axis=1)
        ours, less, more = self.modes
        shared, both = (real + imaginary) @ ours, np.empty((len(parts), 2 * ours.shape[1]), np.float32)
        np.subtract(shared, imaginary @ more, out=both[:, : ours.shape[1]])
        np.add(shared, real @ less, out=both[:, ours.shape[1] :])
        return both


def _magnitude(there: Single) -> Single:
    """Magnitude at the loudest point, shape (frame,), of (frame, real and imaginary, ...)."""
    # In place: a new array for each step would cost more than the steps.
    np.multiply(there, there, out=there)
    power = np.add(there[:, 0], there[:, 1], out=there[:, 0])
    return np.sqrt(power.reshape(len(there), -1).max(axis=1))


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


@lru_cache(maxsize=16)
def _cube_search(place: Place, alike: _Alike, acoustics: Acoustics) -> CubeSearch | PointSearch:
    array = alike.array
    if not place.enforced or place.reach == 0:
        return point_search(place.points, array, acoustics)
    ceiling = np.abs(transfer_matrix(place.points, array, acoustics=acoustics)).max(axis=0)
    # Far below what counts as silence there are no modes: single precision has no numbers for them.
    if ceiling.sum() < 1e-9:
        return point_search(place.points, array, acoustics)
    step, tried = NODES, 160
    while True:
        # What is left out is 48 dB below all transducers in step.
        found = _search(place, array, acoustics, ceiling, step=step, tried=tried)
        if found.left_out < 4e-3 * ceiling.sum() or step < 0.7 * NODES:
            return found
        step, tried = 0.85 * step, 2 * tried


def point_search(points: Array, array: TransducerArray, acoustics: Acoustics) -> PointSearch:
    """The search of some points, shape (point, 3), in m."""
    field = transfer_matrix(points, array, acoustics=acoustics)
    return PointSearch(field=_real(field.T), ceiling=np.abs(field).max(axis=0))


def searched_points(place: Place, array: TransducerArray, acoustics: Acoustics) -> Array:
    """The points of a place's cube at which a drive is looked at, shape (point, 3), in m."""
    if not place.enforced or place.reach == 0:
        return place.points
    inside, faces = _lattices(bands(place, array, acoustics))
    on_a_face = np.abs(faces.points).max(axis=1) == 1
    share = np.concatenate([inside.points, faces.points[on_a_face]])
    return np.array(place.position) + place.reach * share


def _lattices(wide: Array) -> tuple[Lattice, Lattice]:
    """Points inside the cube, and those of which the ones on its faces count."""
    inside = lattice(wide, INSIDE)
    x, y, z = (each[1:-1] for each in inside.axes)
    return Lattice(axes=(x, y, z)), lattice(wide, FACES)


def _search(
    place: Place, array: TransducerArray, acoustics: Acoustics, ceiling: Array, *, step: float, tried: int
) -> CubeSearch:
    """By modes of the field at some nodes, and by what lies between the nodes."""
    wide, enough = bands(place, array, acoustics), 1e-3 * float(ceiling.sum())
    nodes = lattice(wide, step, crowd=2.0)
    field = slow_field(nodes.points, place, array, acoustics)
    waves, modes = _modes(field, min(tried, *field.shape), enough)
    # The planes lie across the axis along which the field changes most.
    first = int(wide.argmax())
    order = (first, *(axis for axis in range(3) if axis != first))
    planes = np.moveaxis(waves.reshape(*nodes.shape, -1), first, 0)
    planes = planes.reshape(len(planes), -1, waves.shape[1])
    few = _shapes(planes * np.linalg.norm(modes, axis=1), 0.4 * enough / np.sqrt(array.count))
    told = few.T.astype(np.float32) @ planes

    def at(where: Lattice) -> list[Array]:
        return [between(nodes.axes[axis], where.axes[axis], float(wide[axis])) for axis in order]

    inside, faces = _lattices(wide)
    tests = _tests()
    x, y, z = at(Lattice(axes=(tests[:, 0], tests[:, 1], tests[:, 2])))
    section = np.einsum("ty,tz->tyz", y, z).reshape(len(tests), -1) @ few
    weights = np.einsum("tp,ts->tps", x, section).reshape(len(tests), -1)
    made = weights.astype(np.float32) @ told.reshape(-1, told.shape[2]) @ modes
    return CubeSearch(
        modes=(_packed(modes.real.T), _packed((modes.imag - modes.real).T), _packed((modes.imag + modes.real).T)),
        shapes=_real(told.reshape(-1, told.shape[2]).T),
        planes=len(planes),
        points=_points(at(inside), at(faces), few),
        # A quarter more than where it was measured.
        left_out=1.25 * float(np.abs(slow_field(tests, place, array, acoustics) - made).sum(axis=1).max()),
        ceiling=ceiling,
    )


def _points(inside: list[Array], faces: list[Array], few: Array) -> tuple[Points, ...]:
    """Inside, on the four faces across the planes, and on the two that are planes themselves."""

    def across(one: Array, other: Array) -> Single:
        return (np.kron(one, other) @ few).T.astype(np.float32)

    rim = np.zeros((len(faces[1]), len(faces[2])), bool)
    rim[[0, -1]] = rim[:, [0, -1]] = True
    every, ends, face = slice(None), slice(None, None, inside[0].shape[1] - 1), across(*faces[1:])
    return (
        Points(planes=every, across=_packed(across(*inside[1:])), along=inside[0].astype(np.float32)),
        Points(planes=every, across=_packed(face[:, rim.ravel()]), along=faces[0].astype(np.float32)),
        Points(planes=ends, across=_packed(face), along=None),
    )


def _packed(matrix: Single) -> Single:
    return np.ascontiguousarray(matrix)


def _shapes(planes: NDArray[np.complex64], enough: float) -> Array:
    """Real patterns whose sums are the field on each plane but for enough in the mean, shape (point, pattern)."""
    parts = np.concatenate([planes.real, planes.imag], axis=2).transpose(1, 0, 2).reshape(planes.shape[1], -1)
    power, vectors = np.linalg.eigh((parts @ parts.T).astype(np.float64))
    rest = np.cumsum(np.maximum(power, 0)) / (planes.shape[0] * planes.shape[1])
    return np.asarray(vectors[:, rest > enough**2], np.float64)


def _tests() -> Array:
    """Corners, edges, faces and other points of the cube, where it is measured what is left out."""
    corners = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    # Always the same, so that a drive always measures the same.
    others = np.clip(np.random.default_rng(0).uniform(-1.2, 1.2, (133, 3)), -1, 1)
    return np.concatenate([corners, others])


def _modes(field: NDArray[np.complex64], tried: int, enough: float) -> Modes:
    """Shapes and modes whose product is the field but for less than enough, (point, mode) and (mode, transducer).

    From as many random drives as are tried (Halko, Martinsson & Tropp 2011, SIAM Review 53, 217, section 4.1).
    """
    # Any drives do as long as they have nothing in common; always the same, so that a drive always measures the same.
    drives = np.random.default_rng(0).standard_normal((field.shape[1], tried), dtype=np.float32)
    # The squares of single precision would drown the weaker half.
    found = (field @ drives.astype(np.complex64)).astype(np.complex128)
    power, vectors = np.linalg.eigh(found.conj().T @ found)
    shapes = (found @ (vectors / np.sqrt(np.maximum(power, 1e-14 * power[-1])))[:, ::-1]).astype(np.complex64)
    modes = shapes.conj().T @ field
    # No drive at full level can bring out more of a mode than the square root of the count times its norm.
    rest = np.abs(shapes) ** 2 * (np.abs(modes) ** 2).sum(axis=1) * field.shape[1]
    after = np.sqrt(np.cumsum(rest[:, ::-1], axis=1)[:, ::-1].max(axis=0))
    count = int((after > 1.2 * enough).sum())
    return shapes[:, :count], modes[:count]


def _real(matrix: NDArray[np.complexfloating]) -> Single:
    """A complex matrix as one of real numbers, from (real, imaginary) parts to (real, imaginary) parts."""
    return np.ascontiguousarray(np.block([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]]).astype(np.float32))
