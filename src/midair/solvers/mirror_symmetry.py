"""Mirror symmetry of an array: its modes by kind, and products with them that take a quarter of the work.

Two by two AUTD3 units are a lattice with 12 empty places, symmetric under mirrors along x and y. Its modes are even or
odd under each mirror. A drive split into four kinds, each on a quarter of the places, needs a quarter of the work for a
product with V, and so do fields at points that are their own mirror images.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers.backend import Backend, Numbers, Rows
from midair.solvers.modes import Modes, modes

Complex = NDArray[np.complex128]

SIDES = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])
"""Signs of x and y of each image."""

KINDS = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
"""Sign of each kind on each image, shape (kind, image); orthonormal, and its own inverse."""

_EMPTY, _MORE = 1.1, 1.3
"""Limits of symmetry: most places per transducer, and most modes over those of the whole array, where it saves work."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lattice:
    """A symmetric array with its empty places filled, image after image."""

    array: TransducerArray  # Transducers that are alike, one at each place
    place: NDArray[np.intp]  # Index of each real transducer among all places
    weight: Array  # Amplitude of the real transducer at each place, shape (place,); 0 where there is none
    angle: Array  # Measured phase of each real transducer in rad, shape (transducer,)

    @classmethod
    def of(cls, array: TransducerArray) -> "Lattice | None":
        """None if the array has no mirror symmetry."""
        if np.ptp(array.normal, axis=0).any() or np.abs(array.normal[0, :2]).any():
            return None
        middle = (array.position.min(axis=0) + array.position.max(axis=0)) / 2
        offset = array.position - middle
        # Rounded to a micrometre, far above rounding errors and far below the distance of transducers.
        steps = np.rint(np.abs(offset) * 1e6).astype(np.int64)
        _, first, at = np.unique(steps, axis=0, return_index=True, return_inverse=True)
        quarter = np.abs(offset[first])
        if (steps[:, :2] == 0).any() or 4 * len(quarter) > _EMPTY * array.count:
            return None
        side = (offset[:, 0] < 0) + 2 * (offset[:, 1] < 0)
        sides = np.concatenate([SIDES, np.ones((4, 1))], axis=1)
        position = middle + (sides[:, None] * quarter).reshape(-1, 3)
        place, weight = side * len(quarter) + at.reshape(-1), np.zeros(len(position))
        weight[place] = np.abs(array.response)
        whole = TransducerArray(
            position=position,
            normal=np.repeat(array.normal[:1], len(position), axis=0),
            pressure=array.pressure,
            frequency=array.frequency,
            reflection=array.reflection,
        )
        return cls(array=whole, place=place, weight=weight, angle=np.angle(array.response))

    @property
    def middle(self) -> tuple[float, float]:
        """The middle (x, y) of the places in m."""
        x, y, _ = (self.array.position.min(axis=0) + self.array.position.max(axis=0)) / 2
        return float(x), float(y)

    def phase(self, theta: Array) -> Array:
        """Phases of the real transducers (frame, transducer) from those of all places (frame, place), in rad."""
        return theta[:, self.place] - self.angle


def mirror_images(points: Array, middle: tuple[float, float]) -> tuple[NDArray[np.intp], Array] | None:
    """Indices of points (point, 2 or 3) as images of those of a quarter, (image, point); None if they lack images.

    A point on a mirror is its own image and has several places; the second array is the share of each, (point,).
    """
    steps = np.rint((points[:, :2] - middle) * 1e6).astype(np.int64)
    quarter, known = steps[(steps >= 0).all(axis=1)], {tuple(at): point for point, at in enumerate(steps.tolist())}
    found = [[known.get(tuple(at), -1) for at in (side * quarter).tolist()] for side in SIDES]
    share = np.where(quarter == 0, 0.5, 1.0).prod(axis=1)
    whole = not any(-1 in image for image in found) and 4 * share.sum() == len(points)
    return (np.array(found, np.intp), share) if whole else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SymmetricModes:
    """G = U diag(s) W^H with W of four kinds, or of one for an array without symmetry."""

    U: Complex  # Fields, shape (point, kind * mode); kinds with fewer modes are padded with zeros
    s: Array  # Singular values in the unit of G, shape (kind * mode,)
    V: Complex  # Drives of each kind on the places of one image, shape (kind, mode, place)
    place: NDArray[np.intp]  # Index of each transducer among all places, image after image

    def drive(self, z: Complex) -> Complex:
        """W z, shape (transducer,), of coordinates z (kind * mode,)."""
        kinds = np.einsum("kmn,km->kn", self.V, z.reshape(self.V.shape[:2]))
        return (kinds if len(kinds) == 1 else KINDS.T @ kinds).reshape(-1)[self.place]


def full_phase(modes: Modes) -> SymmetricModes:
    """The modes of any array as one kind on one image."""
    return SymmetricModes(U=modes.U, s=modes.s, V=modes.V.T[None], place=np.arange(len(modes.V)))


def symmetric_modes(
    grid: ControlGrid, array: TransducerArray, *, acoustics: Acoustics, tolerance: float
) -> SymmetricModes | None:
    """The modes of an array by kind, in units of the strongest focus; None without symmetry, or if it saves nothing.

    Modes below `tolerance` times the strongest are left out.
    """
    lattice = Lattice.of(array) if array.alike else None
    if lattice is None:
        return None
    G = transfer_matrix(grid, lattice.array, acoustics=acoustics) / focus_amplitude(grid, array, acoustics=acoustics)
    of_kinds = by_kind(G)
    found = [np.linalg.svd(fields, full_matrices=False) for fields in of_kinds]
    strongest = max(float(s[0]) for _, s, _ in found)
    each = [int((s > tolerance * strongest).sum()) for _, s, _ in found]
    # Points far from the centre couple to all kinds.
    if sum(each) > _MORE * max(np.linalg.matrix_rank(G, tolerance * np.linalg.norm(G, 2)), 1):
        return None
    most = max(each)
    U = np.zeros((grid.count, len(KINDS), most), np.complex128)
    s, V = np.zeros((len(KINDS), most)), np.zeros((len(KINDS), most, of_kinds.shape[2]), np.complex128)
    for kind, ((fields, strength, drives), count) in enumerate(zip(found, each, strict=True)):
        U[:, kind, :count], s[kind, :count] = fields[:, :count], strength[:count]
        V[kind, :count] = drives[:count].conj()
    return SymmetricModes(U=U.reshape(grid.count, -1), s=s.reshape(-1), V=V, place=lattice.place)


def by_kind(G: Complex) -> Complex:
    """The fields (row, place) of drives of each kind on one image, shape (kind, row, place of the image)."""
    return np.asarray(np.einsum("ki,pin->kpn", KINDS, G.reshape(len(G), len(KINDS), -1)))


def modes_by_kind(G: Complex, tolerance: float) -> tuple[Array, Complex]:
    """Singular values (kind * mode,) and drives V (kind, mode, place) of G (row, place), as many modes of each kind.

    Those above `tolerance` times the strongest, and weaker ones of kinds that have fewer; where a kind has none, V is
    0.
    """
    found = [modes(fields, tolerance=0.1 * tolerance) for fields in by_kind(G)]
    least = max(tolerance, 1e-9) * max(float(each.s[0]) for each in found)
    most = max(int((each.s > least).sum()) for each in found)
    s, V = np.full((4, most), least), np.zeros((4, most, G.shape[1] // 4), np.complex128)
    for kind, each in enumerate(found):
        # A kind can be silent, except for rounding.
        count = int((each.s[:most] > 1e-3 * least).sum())
        s[kind, :count], V[kind, :count] = each.s[:count], each.V[:, :count].T
    return s.reshape(-1), V


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Product:
    """Products of rows with a matrix M (mode, column), and with its adjoint."""

    backend: Backend
    matrix: Rows  # M, shape (mode, column)
    back: Rows  # Its adjoint

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of modes and of columns, of all kinds and images."""
        *_, modes, columns = self.matrix.shape
        return self.images * modes, self.images * columns

    @property
    def images(self) -> int:
        """Number of images of which the columns consist: four if folded."""
        return 1 if self.matrix.ndim == 2 else 4

    def sampled(self, some: NDArray[np.int64], root: Numbers) -> "Product":
        """The product with these columns of each image and each mode divided by a number, shape (mode,)."""
        matrix = self.backend.xp.take(self.matrix, self.backend.put(some), axis=1) / root[:, None]
        return Product(backend=self.backend, matrix=matrix, back=self.backend.adjoint(matrix))

    def of_modes(self, b: Rows) -> Rows:
        """The product b M, from rows (row, mode) to rows (row, column)."""
        return b @ self.matrix

    def to_modes(self, y: Rows) -> Rows:
        """The product y M^H, from rows (row, column) to rows (row, mode)."""
        return y @ self.back

    def phasors(self, theta: Rows) -> tuple[Any, Rows]:
        """Drives q = exp(j theta), in a form for `slope`, and q M^H, for theta (row, column) in rad."""
        q = self.backend.phasor(theta)
        return q, self.to_modes(q)

    def slope(self, q: Any, b: Rows) -> Rows:
        """The imaginary part of conj(q) (b M), shape (row, column): the slope by the phases, with b (row, mode)."""
        xp, back = self.backend.xp, self.of_modes(b)
        if xp is not np:
            return xp.real(q) * xp.imag(back) - xp.imag(q) * xp.real(back)
        back *= xp.conj(q)
        # NumPy's imaginary part is a strided view that would keep the whole product in memory.
        return xp.asarray(xp.imag(back), copy=True)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoldedProduct(Product):
    """The product with V of four kinds, `matrix` (kind, mode, column of an image), and a factor on each place."""

    weight: Numbers = None  # Factor of each column, shape (image * column,); 1 if None

    @classmethod
    def of(cls, backend: Backend, first: Complex, weight: Array | None = None) -> "FoldedProduct":
        """From the columns of each kind on the first image (kind, mode, column) and a factor of each column."""
        matrix = backend.put(first)
        own = None if weight is None else backend.put(weight)
        return cls(backend=backend, matrix=matrix, back=_adjoints(matrix), weight=own)

    def sampled(self, some: NDArray[np.int64], root: Numbers) -> "FoldedProduct":
        """The product with these columns of each image and each mode divided by a number, shape (kind * mode,)."""
        matrix = np.ascontiguousarray(self.matrix[:, :, some] / root.reshape(4, -1, 1))
        weight = None if self.weight is None else self.weight.reshape(4, -1)[:, some].reshape(-1)
        return replace(self, matrix=matrix, back=_adjoints(matrix), weight=weight)

    def of_modes(self, b: Rows) -> Rows:
        """The product b M, from rows (row, kind * mode) to rows (row, image * column)."""
        y = _mirrored(self._each(b, self.matrix))
        return y if self.weight is None else self.weight * y

    def to_modes(self, y: Rows) -> Rows:
        """The product y M^H, from rows (row, image * column) to rows (row, kind * mode)."""
        return self._each(_mirrored(y if self.weight is None else self.weight * y), self.back)

    def _each(self, x: Rows, matrices: Rows) -> Rows:
        kinds, inner, outer = matrices.shape
        made: Any = np.empty((len(x), kinds, outer), x.dtype)
        # BLAS reads and writes the strided views without a copy.
        np.matmul(x.reshape(-1, kinds, inner).transpose(1, 0, 2), matrices, out=made.transpose(1, 0, 2))
        return made.reshape(-1, kinds * outer)


def _adjoints(matrix: Rows) -> Rows:
    return np.ascontiguousarray(matrix.conj().transpose(0, 2, 1))


def _mirrored(x: Rows) -> Rows:
    """Twice the even and odd parts of rows (row, image * column) under the mirrors, or of such parts, the images."""
    signs = (2 * KINDS).astype(x.real.dtype)  # one product takes a quarter of the time of eight sums
    return (signs @ x.view(signs.dtype).reshape(len(x), 4, -1)).reshape(len(x), -1).view(x.dtype)
