"""The few fields that an array can really make at the control points: a low-rank factor of G.

At 200 mm 136 of the 256 singular values of the paper's G are above 1 % of the first: neighbouring points are closer
than the sound can tell apart. G = U diag(s) V^H without the small s is the cheaper way through G, and V^H q are the
only 2 r numbers of q that matter.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """G = U diag(s) V^H, largest singular values first.

    Attributes
    ----------
    U : ndarray of complex, shape (point, mode)
        Fields, orthonormal columns.
    s : ndarray, shape (mode,)
        Singular values, in the unit of G.
    V : ndarray of complex, shape (transducer, mode)
        Drives, orthonormal columns.
    """

    U: Complex
    s: Array
    V: Complex

    @property
    def rank(self) -> int:
        """Number of modes."""
        return len(self.s)


def modes(G: Complex, *, tolerance: float = 0.0) -> Modes:
    """The modes of G whose singular value is above `tolerance` times the largest.

    Parameters
    ----------
    G : ndarray of complex, shape (point, transducer)
        Transfer matrix.
    tolerance : float
        0 keeps all but those that are zero in double precision, so that the factor is exact.

    Returns
    -------
    Modes
        At least one.
    """
    if len(G) >= _MANY and tolerance >= 1e-4 and (sketched := _by_sketch(G, tolerance)) is not None:
        return sketched
    # G G^H squares the singular values, and so loses half of the digits of small ones.
    if tolerance >= 1e-6:
        # Its price is the cube of the number of points; that of G^H G the cube of the number of transducers.
        return _by_gram(G, tolerance) if len(G) <= G.shape[1] else _turned(_by_gram(G.conj().T, tolerance))
    U, s, Vh = np.linalg.svd(G, full_matrices=False)
    # What rounding leaves of a zero singular value; `numpy.linalg.matrix_rank` draws the line there too.
    rank = _rank(s, max(tolerance, max(G.shape) * np.finfo(float).eps))
    return Modes(U=U[:, :rank], s=s[:rank], V=Vh[:rank].conj().T)


def _by_gram(G: Complex, tolerance: float) -> Modes:
    """Modes from the eigenvectors of G G^H: four times as fast, and true above 1e-8 of the largest singular value."""
    power, U = np.linalg.eigh(G @ G.conj().T)
    # Rounding makes some of the smallest eigenvalues negative.
    s = np.sqrt(np.maximum(power[::-1], 0))
    rank = _rank(s, tolerance)
    fields, s = U[:, ::-1][:, :rank], s[:rank]
    return Modes(U=fields, s=s, V=(fields.conj().T @ G).conj().T / np.where(s > 0, s, 1))


_MANY = 1000
"""Points from which on a sketch is tried; with fewer, all modes cost less than a sketch and its doubts."""


def _by_sketch(G: Complex, tolerance: float) -> Modes | None:
    """Modes from the fields of random drives, or None where G has too many of them for that to be less work.

    Blocks of fields Q, each without what those before it know, until what they leave of G is small: B = Q^H G has the
    modes of G (Halko, Martinsson & Tropp 2011, SIAM Review 53, 217, sections 4.4 and 5.1; blocks and their stop: Yu,
    Gu & Li 2018, SIAM J. Matrix Anal. Appl. 39, 1339). Nothing is left to chance but the time: ||G||^2 - ||B||^2 in
    Frobenius norms is what is left, and e, its root, bounds what any drive can make of it. By Weyl's inequality no
    squared singular value is off by more than e^2. Modes are kept down to (tolerance s_0)^2 - e^2, so that whatever
    is left out stays below the tolerance, as with the other ways.
    """
    # Always the same drives, so that a problem always has the same modes.
    rng, least = np.random.default_rng(0), min(G.shape)
    block = max(least // 8, 16)
    left, strongest = float(np.linalg.norm(G) ** 2), 0.0
    fields: list[Complex] = []
    heard: list[Complex] = []
    while not heard or left > (0.1 * tolerance * strongest) ** 2:
        count = block * len(fields)
        # A grid wider than the sound is fine has modes up to half its points; only the very large gain even so.
        if count >= 0.75 * least or (count and least < 2 * _MANY and left > strongest**2):
            return None
        new = G @ rng.standard_normal((G.shape[1], block)).astype(np.complex128)
        for _ in range(2):
            # Twice, since what is left is thousands of times smaller than what is taken away.
            for known in fields:
                new -= known @ (known.conj().T @ new)
        fields.append(np.linalg.qr(new)[0])
        heard.append(fields[-1].conj().T @ G)
        left -= float(np.linalg.norm(heard[-1]) ** 2)
        strongest = strongest or float(np.linalg.norm(heard[-1], ord=2))
    Q, found = np.concatenate(fields, axis=1), _by_gram(np.concatenate(heard), 0.0)
    rank = _rank(found.s, np.sqrt(tolerance**2 - max(left, 0.0) / found.s[0] ** 2))
    return Modes(U=Q @ found.U[:, :rank], s=found.s[:rank], V=found.V[:, :rank])


def _turned(kept: Modes) -> Modes:
    """The modes of G^H as those of G."""
    return Modes(U=kept.V, s=kept.s, V=kept.U)


def _rank(s: Array, tolerance: float) -> int:
    return max(int((s > tolerance * s[0]).sum()), 1)
