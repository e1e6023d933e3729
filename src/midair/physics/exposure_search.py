"""The loudest sound anywhere in a cube, for every frame of a drive, from few points and at little cost.

Sound from an array comes to a cube from a narrow cone, so that its magnitude cannot change faster than the width of
that cone lets it. The points follow the cone: close together across it, far apart along it. A finite number of points
still misses something; `ALLOWANCE` is put on for that, and docs/decisions/0015-exposure-bound.md says what a search
for gaps hides all the same: .52 dB at most so far.

A field that comes from a cone has few degrees of freedom, about 130 in the cube around an ear instead of one for each
of 996 transducers. The field is worked out in these modes, in single precision; what they leave out is added.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.propagation import transfer_matrix, wavenumber

Array = NDArray[np.float64]
Single = NDArray[np.float32]

ALLOWANCE = 1.2
"""Put on the loudest point of a cube, in dB: between the points it can be this much louder, and half a decibel more."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CubeSearch:
    """How the loudest sound in the cube of one place follows from what the transducers are told.

    Attributes
    ----------
    modes : ndarray of float32, shape (2 transducer, 2 mode), or None
        From real and imaginary parts of the drive to those of the modes; None where the field is worked out without.
    field : ndarray of float32, shape (2 mode, 2 point)
        From those to the parts of the pressure at each point, in Pa. Of transducers where there are no modes.
    left_out : float
        Most that the modes leave out at any point when every transducer is at full drive, in Pa.
    ceiling : ndarray, shape (transducer,)
        Most that each transducer alone makes in the cube, in Pa; all together cannot make more than the sum.
    allowance : float
        As `ALLOWANCE`; 0 where the points are what counts.
    """

    modes: Single | None
    field: Single
    left_out: float
    ceiling: Array
    allowance: float

    @property
    def points(self) -> int:
        """At how many points the field is worked out."""
        return self.field.shape[1] // 2

    @property
    def work(self) -> int:
        """Multiplications of real numbers that one frame takes."""
        return self.field.size + (0 if self.modes is None else self.modes.size)

    def loudest(self, parts: Single, level: Array) -> Array:
        """Amplitude that no place in the cube exceeds, shape (frame,), in Pa.

        Parameters
        ----------
        parts : ndarray of float32, shape (frame, 2 transducer)
            Real parts of the drive, then its imaginary parts.
        level : ndarray, shape (frame, transducer)
            Its magnitude; may be broadcast.
        """
        field = (parts if self.modes is None else parts @ self.modes) @ self.field
        # Squared in place: a new array for each step would cost more than the steps.
        np.multiply(field, field, out=field)
        half = self.points
        power = np.add(field[:, :half], field[:, half:], out=field[:, :half]).max(axis=1)
        found = 10 ** (self.allowance / 20) * np.sqrt(power.astype(np.float64)) + self.left_out * level.max(axis=1)
        return np.minimum(found, level @ self.ceiling)


@dataclass(frozen=True, slots=True, eq=False)
class _Alike:
    """An array that is the same as any other of its numbers: each file of a drive makes one of its own."""

    array: TransducerArray

    @property
    def numbers(self) -> tuple[object, ...]:
        """All that sound in the air depends on."""
        one = self.array
        return one.position.tobytes(), one.normal.tobytes(), one.pressure, one.frequency

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Alike) and self.numbers == other.numbers

    def __hash__(self) -> int:
        return hash(self.numbers)


def cube_search(place: Place, array: TransducerArray, acoustics: Acoustics) -> CubeSearch:
    """The search of a place: all of its cube where the limit is enforced, its 27 points where it only advises.

    Kept, since a drive is measured in parts, more than once, and one drive after the other.
    """
    return _cube_search(place, _Alike(array), acoustics)


@lru_cache(maxsize=32)
def _cube_search(place: Place, alike: _Alike, acoustics: Acoustics) -> CubeSearch:
    array = alike.array
    corners = np.abs(transfer_matrix(place.points, array, acoustics=acoustics))
    if not place.enforced or place.reach == 0:
        direct = transfer_matrix(place.points, array, acoustics=acoustics)
        return _search(direct, corners, allowance=0.0)
    points = cone_points(place, array, acoustics)
    return _search(_field(points, place, array, acoustics, corners), corners, allowance=ALLOWANCE)


def cone_points(
    place: Place, array: TransducerArray, acoustics: Acoustics, *, step: float = 0.9, margin: float = 2.5e-3
) -> Array:
    """Points of a place's cube, as close as the sound that reaches it can change, shape (point, 3), in m.

    Across the cone they stand like the white squares of a chessboard, along it in prisms one above the other. Those
    outside the cube are put on its surface, which lies `margin` further out: sound outside can be far louder than
    inside, and its flank is then steepest at the surface.

    Parameters
    ----------
    place, array, acoustics
        As in `cube_search`.
    step : float
        By how much the phase between two waves from the edges of the cone may change from a point to the next, in rad.
    margin : float
        How much further than the cube is searched, in m.
    """
    away = place.points[:, None, :] - array.position[None, :, :]
    axes, half = _cone((away / np.linalg.norm(away, axis=2, keepdims=True)).reshape(-1, 3))
    reach = place.reach + margin
    # A cone of one transducer is a line: never further apart than the cube is wide.
    apart = np.minimum(step / np.maximum(wavenumber(array, acoustics.medium) * half, 1e-9), 2 * reach)
    count = np.ceil(reach * np.abs(axes).sum(axis=1) / apart).astype(int) + 1
    i, j, k = (each.ravel() for each in np.meshgrid(*[np.arange(-n, n + 1) for n in count], indexing="ij"))
    white = (i + j) % 2 == 0
    steps = np.stack([i, j, k + 0.5 * (i % 2)], axis=1)[white]
    free = steps * apart @ axes
    kept = np.clip(free, -reach, reach)
    moved = np.abs((kept - free) @ axes.T) / apart
    # Those that are moved by more than a prism and a half stand for nothing inside.
    kept = kept[(moved[:, 0] + moved[:, 1] <= 1.5) & (moved[:, 2] <= 0.8)]
    return np.unique(np.round(kept, 4), axis=0) + np.array(place.position)


def _cone(directions: Array) -> tuple[Array, Array]:
    """Axes, one a row, of the cone that directions make, the last one along it; and its half width along each."""
    along = directions.mean(axis=0)
    along /= np.linalg.norm(along)
    aside = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    aside /= np.linalg.norm(aside)
    across = np.cross(along, aside)
    # Turned until the cone is narrowest: a square array seen along its diagonal would seem twice as large.
    turned = [
        np.stack([np.cos(turn) * aside + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * aside, along])
        for turn in np.radians(np.arange(0, 90, 7.5))
    ]
    widths = [np.ptp(directions @ axes.T, axis=0) / 2 for axes in turned]
    best = int(np.argmin([width[0] * width[1] for width in widths]))
    return turned[best], widths[best]


def _field(
    points: Array, place: Place, array: TransducerArray, acoustics: Acoustics, corners: Array
) -> NDArray[np.complex64]:
    """`transfer_matrix` in a fifth of its time: the magnitude changes slowly, so that 27 points of it are enough."""
    share = (points - np.array(place.position)) / place.reach
    x, y, z = (np.stack([(s - 1) * s / 2, 1 - s * s, (s + 1) * s / 2], axis=1) for s in share.T)
    weights = np.einsum("ma,mb,mc->mabc", x, y, z).reshape(len(points), 27)
    field = np.empty((len(points), array.count), np.complex64)
    magnitude = weights.astype(np.float32) @ corners.astype(np.float32)
    turns_per_metre = wavenumber(array, acoustics.medium) / (2 * np.pi)
    for first in range(0, len(points), 64):
        part = slice(first, first + 64)
        square = sum((points[part, a, None] - array.position[None, :, a]) ** 2 for a in range(3))
        turns = turns_per_metre * np.sqrt(square)
        # Whole turns go before single precision: hundreds of radians would leave too few digits.
        angle = (2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
        field.real[part] = magnitude[part] * np.cos(angle)
        field.imag[part] = magnitude[part] * np.sin(angle)
    return field


def _search(field: NDArray[np.complexfloating], corners: Array, *, allowance: float) -> CubeSearch:
    """Of a field, shape (point, transducer), by modes where that is less work."""
    field = field.astype(np.complex64)
    ceiling = corners.max(axis=0)
    # What modes leave out is 52 dB below all transducers in step.
    enough = 2.5e-3 * float(ceiling.sum())
    tried = min(160, len(field) // 3)
    while 0 < tried * sum(field.shape) < field.size:
        shapes, modes = _modes(field, tried, enough)
        left_out = float(np.abs(field - shapes @ modes).sum(axis=1).max())
        if left_out < enough:
            return CubeSearch(
                modes=_real(modes.T), field=_real(shapes.T), left_out=left_out, ceiling=ceiling, allowance=allowance
            )
        tried = 2 * tried
    return CubeSearch(modes=None, field=_real(field.T), left_out=0.0, ceiling=ceiling, allowance=allowance)


def _modes(
    field: NDArray[np.complex64], tried: int, enough: float
) -> tuple[NDArray[np.complex64], NDArray[np.complex64]]:
    """Shapes and modes whose product is the field but for less than enough, (point, mode) and (mode, transducer).

    From as many random drives as are tried (Halko, Martinsson & Tropp 2011, SIAM Review 53, 217, section 4.1).
    """
    # Any drives do as long as they have nothing in common; always the same, so that a drive always measures the same.
    drives = np.random.default_rng(0).standard_normal((field.shape[1], tried)).astype(np.complex64)
    # The squares of single precision would drown the weaker half.
    found = (field @ drives).astype(np.complex128)
    power, vectors = np.linalg.eigh(found.conj().T @ found)
    shapes = (found @ (vectors / np.sqrt(np.maximum(power, 1e-14 * power[-1])))[:, ::-1]).astype(np.complex64)
    modes = shapes.conj().T @ field
    # No drive at full level can bring out more of a mode than the square root of the count times its norm.
    rest = np.abs(shapes) ** 2 * (np.abs(modes) ** 2).sum(axis=1) * field.shape[1]
    after = np.sqrt(np.cumsum(rest[:, ::-1], axis=1)[:, ::-1].max(axis=0))
    count = int((after > 0.7 * enough).sum())
    return shapes[:, :count], modes[:count]


def _real(matrix: NDArray[np.complexfloating]) -> Single:
    """A complex matrix as one of real numbers, from (real, imaginary) parts to (real, imaginary) parts."""
    return np.ascontiguousarray(np.block([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]]).astype(np.float32))
