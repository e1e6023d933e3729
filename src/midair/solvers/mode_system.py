"""The damped linear system of one Levenberg-Marquardt step, in the modes of G.

Three savings over the plain form, none of which changes the step:

1. psi is eliminated. Each psi_m affects one point only, so J_psi J_psi^T + lambda I is a 2 x 2 block per point with a
   known inverse; with v = -j u the direction in which psi changes p u, and weights w = p^2 / (lambda + p^2), lambda
   (J_psi J_psi^T + lambda I)^-1 f = f - w v (v . f).
2. G = U diag(s) V^H. Residuals that no drive can change need no equations: 2 r unknowns z = U^H y remain, (lambda I +
   (I - Q) K) z = U^H (f - w v (v . f)), with K = B B^T of the rows [-I; R] of R + j I = A diag(s) V^H diag(exp j
   theta), and Q = F^T F of the rows sqrt(w_m) v_m . U_m.
3. K is known except for two symmetric blocks of r rows. (R + j I)(R + j I)^H = A^2 diag(s^2) for any phases, so I I^T =
   A^2 diag(s^2) - R R^T, and R I^T = I R^T = ((R + I)(R + I)^T - A^2 diag(s^2)) / 2.

Then h_theta = -B^T z, and h_psi is the best psi for it: -p / (lambda + p^2) v . (f - U K z).
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.solvers.modes import Modes

Array = NDArray[np.floating[Any]]
Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class System:
    """The factors of one G in one precision."""

    U: Complex  # Orthonormal fields, shape (point, mode)
    C: Complex  # A diag(s) V^H, shape (mode, transducer)
    real: Array  # Real part of C
    imaginary: Array  # Imaginary part of C
    power: Array  # (A s)^2, shape (mode,)
    work: Array  # Workspace of `normal`, shape (3, mode, transducer)

    @classmethod
    def of(cls, kept: Modes, level: float, precision: Literal["single", "double"]) -> "System":
        """Make the system from the modes of G and the level A."""
        real = np.float32 if precision == "single" else np.float64
        kind = np.complex64 if precision == "single" else np.complex128
        C = np.ascontiguousarray((level * kept.s)[:, None] * kept.V.conj().T, kind)
        return cls(
            U=kept.U.astype(kind),
            C=C,
            real=C.real.copy(),
            imaginary=C.imag.copy(),
            power=np.asarray((level * kept.s) ** 2, real),
            work=np.empty((3, *C.shape), real),
        )

    def residual(self, p: Array, x: NDArray[np.float64]) -> Complex:
        """G q - diag(p) u, shape (point,)."""
        wave = np.exp(1j * x)
        count = self.C.shape[1]
        return self.U @ (self.C @ wave[:count].astype(self.C.dtype)) - p * wave[count:]

    def gradient(self, p: Array, x: NDArray[np.float64], residual: Complex) -> NDArray[np.float64]:
        """J^T f, shape (transducer + point,)."""
        count = self.C.shape[1]
        wave = np.exp(1j * x)
        back = (residual.conj().astype(self.C.dtype) @ self.U) @ self.C
        return np.concatenate([-(wave[:count] * back).imag, -p * (wave[count:].conj() * residual).imag])

    def normal(self, x: NDArray[np.float64]) -> Array:
        """K, shape (2 mode, 2 mode), from two symmetric products."""
        r, count = self.C.shape
        kind = self.power.dtype
        cosine, sine = np.cos(x[:count]).astype(kind), np.sin(x[:count]).astype(kind)
        R, both, part = self.work
        np.multiply(self.real, cosine, out=R)
        np.subtract(R, np.multiply(self.imaginary, sine, out=part), out=R)
        np.multiply(self.real, cosine + sine, out=both)
        both += np.multiply(self.imaginary, cosine - sine, out=part)
        product = _blas("syrk", kind)
        # Transposed, the arrays are in Fortran order as BLAS expects; only upper triangles are computed.
        RR, RI = _whole(product(1, R.T, trans=1)), _whole(product(-0.5, both.T, trans=1))
        RI.ravel(order="K")[:: r + 1] += self.power / 2
        K = np.empty((2 * r, 2 * r), kind, order="F")
        np.negative(RR, out=K[:r, :r])
        K[np.arange(r), np.arange(r)] += self.power
        K[r:, r:], K[r:, :r], K[:r, r:] = RR, RI, RI
        return K

    def step(
        self, p: Array, x: NDArray[np.float64], residual: Complex, damping: float, K: Array
    ) -> NDArray[np.float64]:
        """The damped Gauss-Newton step h, shape (transducer + point,), in rad; not finite if lambda is too small.

        p is the target (point,), x = [theta, psi] in rad, K the result of `normal` at x.
        """
        r, count = self.C.shape
        u = np.exp(1j * x[count:])
        stiff = damping + p**2
        w = p**2 / stiff
        # v . y of complex y is Re(conj(v) y) = -Im(conj(u) y), with v = -j u.
        along = -(u.conj() * residual).imag
        b = (residual - w * along * (-1j * u)).astype(self.C.dtype).conj() @ self.U
        z = self._solved(K, u, w, damping, np.concatenate([b.real, -b.imag]))
        k = K @ z
        left = residual - self.U @ (k[:r] + 1j * k[r:])
        back = ((z[:r] - 1j * z[r:]) @ self.C) * np.exp(1j * x[:count])
        return np.concatenate([back.imag, p / stiff * (u.conj() * left).imag])

    def _solved(self, K: Array, u: Complex, w: Array, damping: float, right: Array) -> Array:
        """The z of (lambda I + (I - Q) K) z = right, shape (2 mode,); NaN if the matrix is singular."""
        kind = self.power.dtype
        # A point with target 0 has no psi to eliminate, hence no row.
        sounding = np.flatnonzero(w > 0)
        F = self.U[sounding] * (np.sqrt(w[sounding]) * u[sounding].conj()).astype(self.C.dtype)[:, None]
        # Re(conj(v) y) of y = U z, by the real and the imaginary parts of z; its sign cancels in Q.
        rows = np.concatenate([F.imag, F.real], axis=1)
        Q = _blas("syrk", kind)(1, rows.T)
        matrix = _blas("symm", kind)(-1, Q, K, beta=1, c=K)
        matrix[np.diag_indices_from(matrix)] += damping
        # (I - Q) K is not symmetric; splitting it into two Cholesky factors was slower at 284 rows.
        _, _, x, info = _lapack("gesv", kind)(matrix, right, overwrite_a=True, overwrite_b=True)
        return np.asarray(x) if info == 0 else np.full_like(right, np.nan)


def _whole(upper: Array) -> Array:
    """The symmetric matrix of an upper triangle with zeros below it."""
    return upper + np.triu(upper, 1).T


def _blas(name: str, kind: np.dtype[Any]) -> Any:
    from scipy.linalg import blas

    return getattr(blas, ("s" if kind == np.float32 else "d") + name)


def _lapack(name: str, kind: np.dtype[Any]) -> Any:
    from scipy.linalg import lapack

    return getattr(lapack, ("s" if kind == np.float32 else "d") + name)
