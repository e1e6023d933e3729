"""One step of Levenberg-Marquardt for equal amplitudes, in two forms: with all of G, and in its modes.

Each step solves (J^T J + lambda I) h = -J^T f. The paper prints f without J^T, but then the dimensions do not match.
There are more unknowns than residuals (N + M = 1252, 2M = 512), so the dual form h = -J^T (J J^T + lambda I)^-1 f is
solved, which gives the same step by the push-through identity. Damping by gain ratio and stopping criteria: Madsen,
Nielsen & Tingleff, "Methods for non-linear least squares problems" (2004), section 3.2.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal, Self, cast

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Status
from midair.solvers.modes import Modes
from midair.solvers.problem import Problem, excess_rows, residual

Floats = NDArray[np.floating[Any]]
Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """State of the damped iteration for one frame."""

    x: Array  # [theta, psi] in rad, shape (transducer + point,)
    residual: Complex  # G q - diag(p) u at x, shape (point,)
    gradient: Array  # J^T f at x, shape (transducer + point,)
    cost: float  # || f ||^2 / 2
    damping: float  # lambda
    growth: float = 2.0  # Factor on lambda after a rejected step; it doubles with each one
    iterations: int = 0  # Iterations made, rejected steps included
    status: Status | None = None  # None until the iteration ends
    normal: Floats | None = None  # The matrix of the linear system at x, `normal`, kept after rejected steps
    # Residuals of the guard, shape (active guard point,), and their derivative by theta, (active guard point,
    # transducer), see `problem.excess_rows`; None without a guard
    excess: tuple[Array, Array] | None = None

    def refused(self) -> Self:
        """The same x with more damping; status "stalled" once lambda is above 1e12."""
        worse = self.damping * self.growth
        return replace(self, damping=worse, growth=2 * self.growth, status="stalled" if worse > 1e12 else None)

    def judged(self, trial: Self, promised: float, tolerance: float) -> Self:
        """Accept or reject a trial by its gain ratio: actual over predicted decrease of the cost (Nielsen's rule)."""
        fall = self.cost - trial.cost
        # An exact step always predicts a decrease; a step with rounding errors may not, and is rejected.
        gain = fall / promised if promised > 0 else -1.0
        # "not >" also rejects NaN.
        if not gain > 0:
            return self.refused()
        return replace(
            trial,
            damping=self.damping * max(1 / 3, 1 - (2 * gain - 1) ** 3),
            iterations=self.iterations,
            status="converged" if fall <= tolerance * self.cost else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlainForm:
    """The step with all of G, and with a guard, in double precision."""

    problem: Problem

    def at(self, p: Array, x: Array, damping: float) -> State:
        """The state at x (transducer + point,) for the target p (point,) before its first step."""
        problem, r = self.problem, residual(self.problem, p, x)
        gradient, cost = self._transposed_jacobian(p, x, r), 0.5 * float(np.vdot(r, r).real)
        if problem.guard is None:
            return State(x=x, residual=r, gradient=gradient, cost=cost, damping=damping)
        excess = excess_rows(problem.guard, x[: problem.transducers], problem.level, float(p.max()))
        gradient[: problem.transducers] += excess[0] @ excess[1]
        cost += 0.5 * float(excess[0] @ excess[0])
        return State(x=x, residual=r, gradient=gradient, cost=cost, damping=damping, excess=excess)

    def normal(self, p: Array, x: Array) -> Floats:
        """J J^T, shape (2 point, 2 point).

        With T = A G diag(exp j theta) = R + j I the rows of J by theta are -I and R. R R^T + I I^T = Re(A^2 G G^H) does
        not depend on x, so that two of the three products are enough.
        """
        problem, points = self.problem, self.problem.points
        u: Complex = np.exp(1j * x[problem.transducers :])
        turned: Complex = problem.level * problem.G * np.exp(1j * x[: problem.transducers])
        real, imaginary = turned.real.copy(), turned.imag.copy()
        normal = np.empty((2 * points, 2 * points))
        first, last = slice(0, points), slice(points, None)
        normal[last, last] = real @ real.T
        normal[first, first] = problem.gram.real - normal[last, last]
        normal[last, first] = -(real @ imaginary.T)
        diagonal = np.arange(points)
        normal[diagonal, diagonal] += (p * u.imag) ** 2
        normal[points + diagonal, points + diagonal] += (p * u.real) ** 2
        normal[points + diagonal, diagonal] -= p**2 * u.real * u.imag
        normal[first, last] = normal[last, first].T
        return normal

    def step(self, p: Array, state: State) -> Array:
        """The step h = -J^T (J J^T + lambda I)^-1 f, shape (transducer + point,), in rad.

        NaN if the matrix is not positive definite in double precision.
        """
        from scipy.linalg import cho_factor, cho_solve

        f = np.concatenate([state.residual.real, state.residual.imag])
        # A copy, since the factorisation overwrites it, and J J^T is needed again after a rejected step.
        normal = cast("Floats", state.normal).copy()
        if state.excess is not None:
            normal, f = self._bordered(normal, state), np.concatenate([f, state.excess[0]])
        normal[np.diag_indices_from(normal)] += state.damping
        try:
            # The transpose of a symmetric matrix is the same matrix in Fortran order, as LAPACK expects.
            factor = cho_factor(normal.T, lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            return np.full_like(state.x, np.nan)
        y: Any = cho_solve(factor, f, check_finite=False)
        M = self.problem.points
        h = -self._transposed_jacobian(p, state.x, y[:M] + 1j * y[M : 2 * M])
        if state.excess is not None:
            h[: self.problem.transducers] -= y[2 * M :] @ state.excess[1]
        return h

    def _transposed_jacobian(self, p: Array, x: Array, y: Complex) -> Array:
        """J^T [Re y; Im y] = Re(D^H y), shape (transducer + point,), for complex y of shape (point,)."""
        problem = self.problem
        theta, u = x[: problem.transducers], np.exp(1j * x[problem.transducers :])
        back = (y.conj() @ problem.G).conj()
        return np.concatenate([problem.level * (np.exp(-1j * theta) * back).imag, -(p * u.conj() * y).imag])

    def _bordered(self, normal: Floats, state: State) -> Floats:
        """J J^T with the rows of the guard, shape (2 point + active guard point, the same).

        The rows of J by theta are -I and R, with T = A G diag(exp j theta) = R + j I; the guard does not depend on psi.
        """
        problem, slope = self.problem, cast("tuple[Array, Array]", state.excess)[1]
        turned = problem.level * problem.G * np.exp(1j * state.x[: problem.transducers])
        across = slope @ np.concatenate([-turned.imag, turned.real]).T
        return np.block([[normal, across.T], [across, slope @ slope.T]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalForm:
    """The step in the modes of one G, in one precision, at a fifth of the cost of `PlainForm`.

    Three savings, none of which changes the step:

    1. psi is eliminated. Each psi_m affects one point only, so J_psi J_psi^T + lambda I is a 2 x 2 block per point with
       a known inverse; with v = -j u the direction in which psi changes p u, and weights w = p^2 / (lambda + p^2),
       lambda (J_psi J_psi^T + lambda I)^-1 f = f - w v (v . f).
    2. G = U diag(s) V^H. Residuals that no drive can change need no equations: 2 r unknowns z = U^H y remain, (lambda I
       + (I - Q) K) z = U^H (f - w v (v . f)), with K = B B^T of the rows [-I; R] of R + j I = A diag(s) V^H diag(exp j
       theta), and Q = F^T F of the rows sqrt(w_m) v_m . U_m.
    3. K is known except for two symmetric blocks of r rows. (R + j I)(R + j I)^H = A^2 diag(s^2) for any phases, so
       I I^T = A^2 diag(s^2) - R R^T, and R I^T = I R^T = ((R + I)(R + I)^T - A^2 diag(s^2)) / 2.

    Then h_theta = -B^T z, and h_psi is the best psi for it: -p / (lambda + p^2) v . (f - U K z).
    """

    U: Complex  # Orthonormal fields, shape (point, mode)
    C: Complex  # A diag(s) V^H, shape (mode, transducer)
    real: Floats  # Real part of C
    imaginary: Floats  # Imaginary part of C
    power: Floats  # (A s)^2, shape (mode,)
    work: Floats  # Workspace of `normal`, shape (3, mode, transducer)

    @classmethod
    def of(cls, kept: Modes, level: float, precision: Literal["single", "double"]) -> "ModalForm":
        """Make the form from the modes of G and the level A."""
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

    def at(self, p: Array, x: Array, damping: float) -> State:
        """As of `PlainForm`."""
        count, wave = self.C.shape[1], np.exp(1j * x)
        residual = self.U @ (self.C @ wave[:count].astype(self.C.dtype)) - p * wave[count:]
        back = (residual.conj().astype(self.C.dtype) @ self.U) @ self.C
        gradient = np.concatenate([-(wave[:count] * back).imag, -p * (wave[count:].conj() * residual).imag])
        cost = 0.5 * float(np.vdot(residual, residual).real)
        return State(x=x, residual=residual, gradient=gradient, cost=cost, damping=damping)

    def normal(self, p: Array, x: Array) -> Floats:  # noqa: ARG002
        """K, shape (2 mode, 2 mode), from two symmetric products."""
        from scipy.linalg import get_blas_funcs

        r, count = self.C.shape
        kind = self.power.dtype
        cosine, sine = np.cos(x[:count]).astype(kind), np.sin(x[:count]).astype(kind)
        R, both, part = self.work
        np.multiply(self.real, cosine, out=R)
        np.subtract(R, np.multiply(self.imaginary, sine, out=part), out=R)
        np.multiply(self.real, cosine + sine, out=both)
        both += np.multiply(self.imaginary, cosine - sine, out=part)
        product: Any = get_blas_funcs("syrk", dtype=kind)
        # Transposed, the arrays are in Fortran order as BLAS expects; only upper triangles are computed.
        RR, RI = _whole(product(1, R.T, trans=1)), _whole(product(-0.5, both.T, trans=1))
        RI.ravel(order="K")[:: r + 1] += self.power / 2
        K = np.empty((2 * r, 2 * r), kind, order="F")
        np.negative(RR, out=K[:r, :r])
        K[np.arange(r), np.arange(r)] += self.power
        K[r:, r:], K[r:, :r], K[:r, r:] = RR, RI, RI
        return K

    def step(self, p: Array, state: State) -> Array:
        """The damped Gauss-Newton step h, shape (transducer + point,), in rad; not finite if lambda is too small."""
        x, residual, damping, K = state.x, state.residual, state.damping, cast("Floats", state.normal)
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

    def _solved(self, K: Floats, u: Complex, w: Floats, damping: float, right: Floats) -> Floats:
        """The z of (lambda I + (I - Q) K) z = right, shape (2 mode,); NaN if the matrix is singular."""
        from scipy.linalg import get_blas_funcs, get_lapack_funcs

        kind = self.power.dtype
        # A point with target 0 has no psi to eliminate, hence no row.
        sounding = np.flatnonzero(w > 0)
        F = self.U[sounding] * (np.sqrt(w[sounding]) * u[sounding].conj()).astype(self.C.dtype)[:, None]
        # Re(conj(v) y) of y = U z, by the real and the imaginary parts of z; its sign cancels in Q.
        rows = np.concatenate([F.imag, F.real], axis=1)
        syrk, symm = get_blas_funcs(("syrk", "symm"), dtype=kind)
        matrix = symm(-1, syrk(1, rows.T), K, beta=1, c=K)
        matrix[np.diag_indices_from(matrix)] += damping
        # (I - Q) K is not symmetric; splitting it into two Cholesky factors was slower at 284 rows.
        gesv: Any = get_lapack_funcs("gesv", dtype=kind)
        _, _, x, info = gesv(matrix, right, overwrite_a=True, overwrite_b=True)
        return np.asarray(x) if info == 0 else np.full_like(right, np.nan)


Form = PlainForm | ModalForm
"""How a step is computed."""


def _whole(upper: Floats) -> Floats:
    """The symmetric matrix of an upper triangle with zeros below it."""
    return upper + np.triu(upper, 1).T
