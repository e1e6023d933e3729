"""Modes of an array with mirror symmetry: four problems of a quarter of the size.

Two by two AUTD3 units are a lattice with 12 empty places, symmetric under mirrors along x and y. Its modes are of four
kinds, even or odd under each mirror. A drive split into four kinds, each on a quarter of the places, needs a quarter of
the work for a product with V. The control points need not be centred on the lattice (on AUTD3 they are off by .7 mm);
then only the drives are even or odd, and there are a few more modes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers.modes import Modes

Complex = NDArray[np.complex128]

SIDES = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])
"""Signs of x and y of each image."""

KINDS = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
"""Sign of each kind on each image, shape (kind, image); orthonormal, and its own inverse."""

_EMPTY, _MORE = 1.1, 1.3
"""Largest numbers of places per transducer, and of modes relative to the whole array, at which symmetry saves work."""


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
    lattice = _lattice(array)
    if lattice is None:
        return None
    whole, place = lattice
    G = transfer_matrix(grid, whole, acoustics=acoustics) / focus_amplitude(grid, array, acoustics=acoustics)
    of_kinds = np.einsum("ki,pin->kpn", KINDS, G.reshape(grid.count, len(KINDS), -1))
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
    return SymmetricModes(U=U.reshape(grid.count, -1), s=s.reshape(-1), V=V, place=place)


def _lattice(array: TransducerArray) -> tuple[TransducerArray, NDArray[np.intp]] | None:
    """The array with its empty places filled, image after image, and the index of each transducer in it.

    None if the array has no mirror symmetry, or its transducers differ.
    """
    if not array.alike or np.ptp(array.normal, axis=0).any() or np.abs(array.normal[0, :2]).any():
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
    whole = TransducerArray(
        position=position,
        normal=np.repeat(array.normal[:1], len(position), axis=0),
        pressure=array.pressure,
        frequency=array.frequency,
    )
    return whole, side * len(quarter) + at.reshape(-1)
