"""Products with the drives of an array with mirror symmetry, by a quarter of the multiplications.

Two by two AUTD3 units are a lattice with 12 empty places, symmetric under mirrors along x and y. Its drives are of four
kinds, even or odd under each mirror, and a kind is known from one quarter of the places. G is a sum over kinds,

    G q = sum_k F_k W_k^H (K D q)_k,

where D puts each transducer at its place, with its measured strength and phase, K (`KINDS`) makes the four kinds from
the four mirror images, and the few columns of W_k hold all drives of a kind that can be heard. Control points may be
anywhere: away from the middle their fields F_k are not orthogonal, and there are a few more than G has modes. With
these modes U S V^H, V^H q = S^-1 U^H G q is a small matrix times W^H K D q.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.solvers.backend import Backend, Rows
from midair.solvers.modes import modes

KINDS = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
"""Sign of each kind on each image, shape (kind, image); orthonormal, symmetric, and its own inverse."""

_EMPTY, _WORK = 1.1, 0.8
"""Largest numbers of places per transducer, and of multiplications relative to those without symmetry."""

_FINER = 0.4
"""Tolerance of the drives of a kind relative to that of the modes: fields of different kinds can cancel each other."""


def lattice_seats(position: Array) -> tuple[NDArray[np.intp], int] | None:
    """The place of each transducer, image after image, and the number of places of an image.

    `position` has shape (transducer, 3). None if the positions have no mirror symmetry along both x and y.
    """
    middle = (position.min(axis=0) + position.max(axis=0)) / 2
    offset = position - middle
    # Rounded to a micrometre, far above rounding errors and far below the distance of transducers.
    steps = np.rint(offset * 1e6).astype(np.int64)
    steps[:, :2] = np.abs(steps[:, :2])
    _, first, at = np.unique(steps, axis=0, return_index=True, return_inverse=True)
    if (steps[:, :2] == 0).any() or 4 * len(first) > _EMPTY * len(position):
        return None
    side = (offset[:, 0] < 0) + 2 * (offset[:, 1] < 0)
    return side * len(first) + at.reshape(-1), len(first)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Dense:
    """The product of rows with a matrix, and with its adjoint."""

    matrix: Rows  # Shape (row of the matrix, column)
    adjoint: Rows  # Its conjugate transpose

    @classmethod
    def of(cls, backend: Backend, matrix: Rows) -> "Dense":
        """The product with a matrix of the backend."""
        return cls(matrix=matrix, adjoint=backend.adjoint(matrix))

    @property
    def columns(self) -> int:
        """Length of a row of the product."""
        return self.matrix.shape[1]

    def ahead(self, b: Rows) -> Rows:
        """Rows b times the matrix."""
        return b @ self.matrix

    def back(self, y: Rows) -> Rows:
        """Rows y times the adjoint."""
        return y @ self.adjoint

    def first(self, count: int) -> "Dense":
        """The product with the first columns."""
        return Dense(matrix=self.matrix[:, :count], adjoint=self.adjoint[:count, :])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Folded:
    """The same interface for a matrix V of four kinds: rows of modes, kind after kind, to places, image after image."""

    backend: Backend
    kinds: Rows  # V of each kind, shape (kind, mode of the kind, place of an image)
    adjoint: Rows  # Its conjugate transpose
    # D, strength and phase of each place in each layer, 0 where it is empty, shape (layer, image, place)
    factor: Rows
    conjugate: Rows  # Its conjugate
    mixing: Dense | None = None  # For V of any modes: a small matrix (mode of a kind, mode)

    @classmethod
    def of(cls, backend: Backend, kinds: Complex, factor: Complex) -> "Folded":
        """The product on a backend."""
        return cls(
            backend=backend,
            kinds=backend.put(kinds),
            adjoint=backend.put(kinds.conj().transpose(0, 2, 1)),
            factor=backend.put(factor if factor.imag.any() else factor.real),
            conjugate=backend.put(factor.conj() if factor.imag.any() else factor.real),
        )

    @property
    def columns(self) -> int:
        """Length of a row of the product."""
        return 4 * self.kinds.shape[2] * self.factor.shape[0]

    def ahead(self, b: Rows) -> Rows:
        """Rows V b: the drive, or what one image after the other receives."""
        xp, rows = self.backend.xp, b.shape[0]
        b = b if self.mixing is None else self.mixing.back(b)
        parts = xp.matmul(xp.permute_dims(xp.reshape(b, (rows, 4, -1)), (1, 0, 2)), self.kinds)
        images = self._turned(parts[0, ...], parts[1, ...], parts[2, ...], parts[3, ...])
        return xp.reshape(xp.expand_dims(images, axis=1) * self.conjugate, (rows, -1))

    def back(self, q: Rows) -> Rows:
        """Rows V^H q."""
        xp, rows = self.backend.xp, q.shape[0]
        images = xp.sum(xp.reshape(q, (rows, *self.factor.shape)) * self.factor, axis=1)
        kinds = self._turned(images[:, 0, :], images[:, 1, :], images[:, 2, :], images[:, 3, :])
        parts = xp.matmul(xp.permute_dims(kinds, (1, 0, 2)), self.adjoint)
        b = xp.reshape(xp.permute_dims(parts, (1, 0, 2)), (rows, -1))
        return b if self.mixing is None else self.mixing.ahead(b)

    def _turned(self, a: Rows, b: Rows, c: Rows, d: Rows) -> Rows:
        """K times four parts (row, place), shape (row, 4, place)."""
        e, f, g, h = a + b, a - b, c + d, c - d
        stacked = self.backend.xp.stack([e + g, f + h, e - g, f - h], axis=1)
        stacked *= 0.5
        return stacked


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoldedDrives:
    """The drives of an array by kinds; all kinds have the same number, filled up with weaker ones."""

    W: Complex  # Shape (kind, mode of the kind, place)
    fields: Complex  # F, shape (listener, kind * mode of the kind)
    factor: Complex  # D as in `Folded`, shape (layer, image, place)
    seat: NDArray[np.intp]  # Index of each transducer in `factor`, in memory order

    @classmethod
    def of(
        cls, G: Complex, position: Array, response: Complex | None, *, tolerance: float, rank: int
    ) -> "FoldedDrives | None":
        """The drives heard above `tolerance` of the loudest; None without symmetry, or if it saves nothing.

        `response` (transducer,) is the known strength and phase of each transducer, which G contains; `rank` the number
        of modes of G. Positions that are all there twice are two layers of transducers (`terms.amplitudes`).
        """
        half = len(position) // 2
        layers = 2 if len(position) == 2 * half and np.array_equal(position[:half], position[half:]) else 1
        count = len(position) // layers
        found = lattice_seats(position[:count]) if tolerance >= 1e-4 else None
        if found is None:
            return None
        seat, places = found
        factor = np.zeros((layers, 4 * places), complex)
        factor[:, seat] = 1 if response is None else response.reshape(layers, count)
        known = np.abs(factor[0]) > 0
        at, first = seat[known[seat]], known[seat]
        whole = np.zeros((len(G), 4 * places), complex)
        whole[:, at] = G[:, :count][:, first] / factor[0, at]
        if layers == 2 and np.abs(whole[:, at] * factor[1, at] - G[:, count:][:, first]).max() > 1e-6:
            return None
        made = _kinds_of(whole.reshape(-1, 4, places), known.reshape(4, places), _FINER * tolerance)
        if made is None:
            return None
        each, listeners = made[0].shape[1], len(G)
        if 4 * each * (places + listeners) > _WORK * rank * (G.shape[1] + listeners):
            return None
        return cls(
            W=made[0],
            fields=made[1],
            factor=factor.reshape(layers, 4, places),
            seat=np.concatenate([seat + 4 * places * layer for layer in range(layers)]),
        )


def _kinds_of(whole: Complex, known: NDArray[np.bool_], tolerance: float) -> tuple[Complex, Complex] | None:
    """W (kind, mode, place) and F (point, kind * mode) of a G (point, image, place), whose unknown columns are 0.

    The columns of empty places are chosen so that they need no fields besides those of the other places: in turn, they
    are made from the fields of each kind, and the known columns restored.
    """
    full = known.all(axis=0)
    if not full.any():
        return None
    found = [modes(np.tensordot(sign, whole[:, :, full], axes=(0, 1)), tolerance=0.1 * tolerance) for sign in KINDS]
    strongest = max(each.s[0] for each in found)
    bases = [each.U[:, each.s > 0.1 * tolerance * strongest] for each in found]
    gaps, empty = whole[:, :, ~full], ~known[:, ~full]
    for _ in range(40):
        kinds = np.einsum("ki,pin->kpn", KINDS, gaps)
        kinds = np.stack([U @ (U.conj().T @ each) for U, each in zip(bases, kinds, strict=True)])
        gaps = np.where(empty, np.einsum("ki,kpn->pin", KINDS, kinds), gaps)
    whole = whole.copy()
    whole[:, :, ~full] = gaps
    kinds = [np.tensordot(sign, whole, axes=(0, 1)) for sign in KINDS]
    found = [modes(U.conj().T @ each, tolerance=0.1 * tolerance) for U, each in zip(bases, kinds, strict=True)]
    most = max(int((each.s > tolerance * strongest).sum()) for each in found)
    W = np.zeros((4, most, whole.shape[2]), complex)
    for kind, each in enumerate(found):
        W[kind, : min(most, each.rank)] = each.V[:, :most].T
    fields = [each @ drives.T for each, drives in zip(kinds, W, strict=True)]
    return W, np.concatenate(fields, axis=1)
