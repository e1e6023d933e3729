"""Modes of an array with mirror symmetry, and products by kind: four problems of a quarter of the size.

Two by two AUTD3 units are a lattice with 12 empty places, symmetric under mirrors along x and y. Its modes are of four
kinds, even or odd under each mirror. A drive split into four kinds, each on a quarter of the places, needs a quarter of
the work for a product with V. The control points need not be centred on the lattice (on AUTD3 they are off by .7 mm);
then only the drives are even or odd, and there are a few more modes. Measured transducers differ: their strengths are a
diagonal between the lattice and the array, and their phases are added to those of the drive.
"""

from dataclasses import dataclass
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

_EMPTY, _WORK = 1.1, 0.8
"""Largest numbers of places per transducer, and of operations relative to the whole array, at which symmetry pays."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lattice:
    """A symmetric array with its empty places filled, image after image."""

    array: TransducerArray  # Transducers that are alike, one at each place
    place: NDArray[np.intp]  # Index of each real transducer among all places
    weight: Array  # Amplitude of the real transducer at each place, shape (place,); 0 where there is none
    response: Complex  # Measured factor of each real transducer, shape (transducer,)

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
        )
        return cls(array=whole, place=place, weight=weight, response=array.response)

    def phase(self, theta: Array) -> Array:
        """Phases of the real transducers (frame, transducer) from those of all places (frame, place), in rad."""
        return theta[:, self.place] - np.angle(self.response)


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

    Modes below `tolerance` times the strongest are left out, except to give all kinds as many.
    """
    lattice = Lattice.of(array) if array.alike else None
    if lattice is None:
        return None
    G = transfer_matrix(grid, lattice.array, acoustics=acoustics) / focus_amplitude(grid, array, acoustics=acoustics)
    if (found := modes_by_kind(G, tolerance)) is None:
        return None
    s, V = found
    U = np.einsum("pkn,kmn->pkm", by_kind(G), V).reshape(len(G), -1) / s
    return SymmetricModes(U=U, s=s, V=V, place=lattice.place)


def by_kind(G: Complex) -> Complex:
    """The fields (row, place) of drives of each kind on one image, shape (row, kind, place of the image)."""
    return np.asarray(np.einsum("ki,pin->pkn", KINDS, G.reshape(len(G), len(KINDS), -1)))


def modes_by_kind(G: Complex, tolerance: float) -> tuple[Array, Complex] | None:
    """Singular values (kind * mode,) and drives V (kind, mode, place) of G (row, place), as many modes of each kind.

    Those above `tolerance` times the strongest, and weaker ones of kinds that have fewer; where a kind has none, V is
    0. None if products by kind would not save work.
    """
    found = [modes(fields, tolerance=0.1 * tolerance) for fields in by_kind(G).transpose(1, 0, 2)]
    strongest = max(float(each.s[0]) for each in found)
    least = max(tolerance, 1e-9) * strongest
    most = max(int((each.s > least).sum()) for each in found)
    rows, places = G.shape
    # Points far from the middle couple to all kinds, which then make the same fields: fewer modes would do for all.
    U = np.concatenate([each.U[:, each.s > least] for each in found], axis=1)
    different = U.shape[1] ** 2 / np.linalg.norm(U.conj().T @ U) ** 2
    if 4 * most * (rows + places / 4) > _WORK * different * (rows + places):
        return None
    s, V = np.full((4, most), least), np.zeros((4, most, places // 4), np.complex128)
    for kind, each in enumerate(found):
        # A kind can be silent, except for rounding.
        count = int((each.s[:most] > 1e-3 * least).sum())
        s[kind, :count], V[kind, :count] = each.s[:count], each.V[:, :count].T
    return s.reshape(-1), V


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Product:
    """Products of rows with a matrix M (kind * mode, image * column), of one kind or of four, and with its adjoint."""

    backend: Backend
    matrix: Rows  # M of each kind, shape (kind, mode, column)
    back: Rows  # Its adjoint, shape (kind, column, mode)
    weight: Numbers = None  # Factor of each column, shape (image * column,), or None

    @classmethod
    def of(cls, backend: Backend, matrix: Complex, weight: Array | None = None) -> "Product":
        """From a matrix (mode, column), or one for each kind (4, mode, column), on the host."""
        kinds = matrix[None] if matrix.ndim == 2 else matrix
        # Half of the factor of `KINDS`, so that `_mirrored` has none.
        kinds = kinds if len(kinds) == 1 else kinds / 2
        return cls(
            backend=backend,
            matrix=backend.put(kinds),
            back=backend.put(kinds.conj().transpose(0, 2, 1)),
            weight=None if weight is None else backend.put(weight),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of modes and of columns, of all kinds."""
        kinds, modes, columns = self.matrix.shape
        return kinds * modes, kinds * columns

    def columns(self, some: NDArray[np.int64]) -> "Product":
        """The product with these columns of each image."""
        xp, put, kinds = self.backend.xp, self.backend.put, self.matrix.shape[0]
        every = put((np.arange(kinds)[:, None] * self.matrix.shape[2] + some).reshape(-1))
        return Product(
            backend=self.backend,
            matrix=xp.take(self.matrix, put(some), axis=2),
            back=xp.take(self.back, put(some), axis=1),
            weight=None if self.weight is None else xp.take(self.weight, every),
        )

    def scaled(self, factor: Numbers) -> "Product":
        """The product with each mode multiplied by a real factor, shape (kind * mode,)."""
        each = self.backend.xp.reshape(factor, (*self.matrix.shape[:2], 1))
        across = self.backend.xp.reshape(factor, (self.matrix.shape[0], 1, -1))
        return Product(backend=self.backend, matrix=each * self.matrix, back=across * self.back, weight=self.weight)

    def of_modes(self, b: Rows) -> Rows:
        """The product b M, from rows (row, mode) to rows (row, column)."""
        y = self._each(b, self.matrix)
        y = y if self.matrix.shape[0] == 1 else _mirrored(self.backend.xp, y)
        return y if self.weight is None else self.weight * y

    def to_modes(self, y: Rows) -> Rows:
        """The product y M^H, from rows (row, column) to rows (row, mode)."""
        y = y if self.weight is None else self.weight * y
        return self._each(y if self.matrix.shape[0] == 1 else _mirrored(self.backend.xp, y), self.back)

    def phasors(self, theta: Rows) -> tuple[Any, Rows]:
        """Drives q = exp(j theta), in a form for `turning`, and q M^H, for theta (row, column) in rad."""
        backend = self.backend
        if backend.kernel is None:
            q = backend.phasor(theta)
            return q, self.to_modes(q)
        cosine, sine = (self._images(part) for part in (np.cos(theta), np.sin(theta)))
        kinds = np.empty(cosine.shape, np.complex64)
        backend.kernel.spread(cosine, sine, self._weights, kinds)
        return (cosine, sine), self._each(kinds, self.back)

    def turning(self, q: Any, b: Rows) -> Rows:
        """The imaginary part of conj(q) (b M), shape (row, column): the slope by the phases, with b (row, mode)."""
        xp, kernel = self.backend.xp, self.backend.kernel
        if kernel is not None:
            slope = np.empty((len(b), self.shape[1]), np.float32)
            kernel.turning(self._images(self._each(b, self.matrix)), *q, self._weights, self._images(slope))
            return slope
        back = self.of_modes(b)
        if xp is not np:
            return xp.real(q) * xp.imag(back) - xp.imag(q) * xp.real(back)
        back *= xp.conj(q)
        # NumPy's imaginary part is a strided view that would keep the whole product in memory.
        return xp.asarray(xp.imag(back), copy=True)

    def fitted(self, a: Rows, q: Rows, iterations: int, *, step: float, momentum: float) -> Rows:
        """Drive of magnitude 1 with q M^H close to a, by a heavy ball on the phases that starts at q; see `live`."""
        backend, xp = self.backend, self.backend.xp
        speed = xp.zeros_like(xp.real(q))
        for _ in range(iterations):
            change = self.of_modes(a - self.to_modes(q))
            speed = momentum * speed + step * (xp.real(q) * xp.imag(change) - xp.imag(q) * xp.real(change))
            # Rotate by the angle whose tangent is the speed, which needs no sine.
            q = backend.unit(backend.complex(xp.real(q) - speed * xp.imag(q), xp.imag(q) + speed * xp.real(q)))
        return q

    def _images(self, x: Any) -> Any:
        """Rows (row, image * column) as (row, image, column)."""
        return x.reshape(len(x), self.matrix.shape[0], -1)

    @property
    def _weights(self) -> Any:
        """The weights, shape (image, column)."""
        weight = np.ones(self.shape[1], np.float32) if self.weight is None else self.weight
        return weight.reshape(self.matrix.shape[0], -1)

    def _each(self, x: Rows, matrices: Rows) -> Rows:
        """Multiply each kind of the rows by its matrix."""
        xp, (kinds, inner, outer) = self.backend.xp, matrices.shape
        if kinds == 1:
            return xp.reshape(x, (-1, inner)) @ matrices[0, ...]
        x = xp.permute_dims(xp.reshape(x, (-1, kinds, inner)), (1, 0, 2))
        if xp is not np:
            return xp.reshape(xp.permute_dims(xp.matmul(x, matrices), (1, 0, 2)), (-1, kinds * outer))
        made: Any = np.empty((x.shape[1], kinds, outer), x.dtype)
        # BLAS writes into the strided view without a copy.
        np.matmul(x, matrices, out=made.transpose(1, 0, 2))
        return made.reshape(-1, kinds * outer)


def _mirrored(xp: Any, x: Rows) -> Rows:
    """Twice the even and odd parts of rows (row, image * column) under the mirrors, or of such parts, the images."""
    a, b, c, d = (xp.reshape(x, (x.shape[0], 4, -1))[:, image, :] for image in range(4))
    s, t, u, v = a + b, a - b, c + d, c - d
    return xp.concat([s + u, t + v, s - u, t - v], axis=1)
