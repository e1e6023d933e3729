"""The modes of an array that is its own mirror image: four problems of a quarter of the size.

Two by two units are a lattice with 12 places empty, and the lattice is the same seen in a mirror along x or y. Its
modes are then of four kinds, alike or opposite on either side of each mirror, and a drive taken apart into its four
kinds, on a quarter of the places each, meets a quarter of the modes: a product with V costs a quarter. The control
points need not lie in the middle of the lattice, and on AUTD3 do not by .7 mm, since its middle is that of the
transducers: then their fields are of four kinds in the drives alone, and there are a few more of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers.modes import Modes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

SIDES = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])
"""On which side of the mirrors along x and y each image lies."""

KINDS = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
"""What each kind is on each image, shape (kind, image); orthonormal, and its own inverse."""

_EMPTY, _MORE = 1.1, 1.3
"""Up to so many places a transducer, and so many modes for each of the array as it is, folding is less work."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SymmetricModes:
    """G = U diag(s) W^H, W of four kinds; or of one, for an array that is no mirror image of itself.

    Attributes
    ----------
    U : ndarray of complex, shape (point, kind * mode)
        Fields; kinds with fewer modes than others are filled up with zeros.
    s : ndarray, shape (kind * mode,)
        Strengths, in the unit of G.
    V : ndarray of complex, shape (kind, mode, place)
        Drives of each kind on the places of one image.
    place : ndarray of int, shape (transducer,)
        Where each transducer is among all places, image after image.
    """

    U: Complex
    s: Array
    V: Complex
    place: NDArray[np.intp]

    def drive(self, z: Complex) -> Complex:
        """W z, shape (transducer,), of coordinates z (kind * mode,)."""
        kinds = np.einsum("kmn,km->kn", self.V, z.reshape(self.V.shape[:2]))
        return (kinds if len(kinds) == 1 else KINDS.T @ kinds).reshape(-1)[self.place]


def full_phase(modes: Modes) -> SymmetricModes:
    """The modes of any array: one kind, one image."""
    return SymmetricModes(U=modes.U, s=modes.s, V=modes.V.T[None], place=np.arange(len(modes.V)))


def symmetric_modes(
    grid: ControlGrid, array: TransducerArray, *, acoustics: Acoustics, tolerance: float
) -> SymmetricModes | None:
    """The modes of an array by kinds, in units of the strongest focus; None where that is not less work.

    Parameters
    ----------
    grid : ControlGrid
        Where the field is wanted.
    array : TransducerArray
        That makes it.
    acoustics : Acoustics
        Of the air.
    tolerance : float
        Modes below this part of the strongest are left out.
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
    # Points that lie far from the middle are heard by all kinds alike.
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
    """The array with its empty places filled, image after image, and where each transducer is in it.

    None where it is not its own mirror image, or its transducers are not alike.
    """
    if not array.alike or np.ptp(array.normal, axis=0).any() or np.abs(array.normal[0, :2]).any():
        return None
    middle = (array.position.min(axis=0) + array.position.max(axis=0)) / 2
    offset = array.position - middle
    # On a micrometre, on which no two transducers are alike and rounding is nothing.
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
