"""Levenberg-Marquardt of the paper with a smaller linear system and a better start.

The step is that of `LevenbergMarquardt`, computed from `System` at a fifth of the cost. A frame
without a warm start begins at the phases of the first two steps of `Fast`; a dozen iterations from there give a lower
error than fifty from zero.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Progress
from midair.solvers.fast import Fast
from midair.solvers.levenberg_marquardt import Damped, FrameAnswer, LevenbergMarquardt, solve_in_turn
from midair.solvers.modes import Modes, modes
from midair.solvers.problem import Answer, Problem, Start, WarmStart

Floats = NDArray[np.floating[Any]]
Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class System:
    """The damped linear system of one Levenberg-Marquardt step: the factors of one G in one precision.

    Three savings over the plain form, none of which changes the step:

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

    def residual(self, p: Floats, x: Array) -> Complex:
        """G q - diag(p) u, shape (point,)."""
        wave = np.exp(1j * x)
        count = self.C.shape[1]
        return self.U @ (self.C @ wave[:count].astype(self.C.dtype)) - p * wave[count:]

    def gradient(self, p: Floats, x: Array, residual: Complex) -> Array:
        """J^T f, shape (transducer + point,)."""
        count = self.C.shape[1]
        wave = np.exp(1j * x)
        back = (residual.conj().astype(self.C.dtype) @ self.U) @ self.C
        return np.concatenate([-(wave[:count] * back).imag, -p * (wave[count:].conj() * residual).imag])

    def normal(self, x: Array) -> Floats:
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

    def step(self, p: Floats, x: Array, residual: Complex, damping: float, K: Floats) -> Array:
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


def _whole(upper: Floats) -> Floats:
    """The symmetric matrix of an upper triangle with zeros below it."""
    return upper + np.triu(upper, 1).T


@dataclass(frozen=True, slots=True, kw_only=True)
class Exact:
    """Settings of "exact"; `tolerance=0, precision="double", first="zero"` gives the steps of `LevenbergMarquardt`."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "robust"})
    """Names of the terms that it supports besides the error of the paper."""

    iterations: int = 13
    """Maximum iterations for a frame without a warm start."""
    warm_iterations: int = 20
    """Maximum iterations for a frame that starts at the previous one."""
    start: Start = "previous"
    """Start of every frame after the first."""
    first: Literal["field", "zero"] = "field"
    """Start of a frame without a warm start: phases of the first two steps of `Fast`, or zero as in the paper."""
    tau: float = 1e-3
    """Initial lambda over the largest diagonal element of J^T J."""
    tolerance: float = 5e-3
    """Modes of G below this fraction of the largest singular value are left out, except in the last steps."""
    precision: Literal["single", "double"] = "single"
    """Precision of all but the last steps."""
    last: int = 1
    """Number of final steps with all modes in double precision."""
    step_tolerance: float = 1e-9
    """Converged when the length of the step relative to x is below this."""
    cost_tolerance: float = 1e-10
    """Converged when the relative decrease of the cost is below this."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases frame by frame."""
        system = System.of(modes(problem.G, tolerance=self.tolerance), problem.level, self.precision)
        # Omitted modes and single precision limit the error; the step of the plain method goes below that limit.
        last = self.last if self.precision == "single" or self.tolerance > 0 else 0
        # J^T J has these on its diagonal by theta, and p^2 by psi.
        diagonal = float(((np.abs(problem.G) * problem.level) ** 2).sum(axis=0).max())
        plain = LevenbergMarquardt()

        def one(p: Array, x: Array, iterations: int) -> FrameAnswer:
            state = state_at(system, p, x, self.tau * max(diagonal, float((p**2).max())))
            while state.status is None and state.iterations < max(iterations - last, 1):
                state = self.step(system, p, state)
            # Continue with the current lambda, not with an initial one.
            end = replace(plain.begin(problem, p, state.x), damping=state.damping)
            for _ in range(min(last, iterations - state.iterations)):
                end = plain.step(problem, p, end) if end.status is None else end
            made = state.iterations + end.iterations
            return FrameAnswer(x=end.x, iterations=made, status=end.status or state.status or "iterations")

        return solve_in_turn(
            problem,
            one,
            iterations=(self.iterations, self.warm_iterations),
            start=self.start,
            first=None if after is not None and self.start == "previous" else self._first(problem),
            after=after,
            progress=progress,
        )

    @property
    def first_moves(self) -> Fast:
        """The solver for the initial phases: `Fast` without its refinement."""
        return Fast(iterations=0, more_iterations=0)

    def step(self, system: System, p: Array, state: Damped) -> Damped:
        """Make one iteration: accept a step that lowers the cost, otherwise raise lambda."""
        K = system.normal(state.x) if state.normal is None else state.normal
        state = replace(state, iterations=state.iterations + 1, normal=K)
        h = system.step(p, state.x, state.residual, state.damping, K)
        if not np.isfinite(h).all():
            return state.refused()
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        trial = state_at(system, p, state.x + h, state.damping)
        promised = 0.5 * float(h @ (state.damping * h - system.gradient(p, state.x, state.residual)))
        return state.judged(trial, promised, self.cost_tolerance)

    def _first(self, problem: Problem) -> Array | None:
        """Initial [theta, psi] of frames without a warm start, shape (frame, transducer + point); None for zero."""
        alone = np.flatnonzero(problem.amplitude.any(axis=1))
        if self.first == "zero" or not len(alone):
            return None
        # With warm starts only the first audible frame is on its own.
        alone = alone if self.start == "zero" else alone[:1]
        some = replace(problem, amplitude=problem.amplitude[alone])
        x = np.zeros((len(problem.amplitude), problem.transducers + problem.points))
        theta = self.first_moves.solve(some).phase
        x[alone] = np.hstack([theta, np.where(some.amplitude > 0, np.angle(some.field(theta)), 0.0)])
        return x


def state_at(system: System, p: Array, x: Array, damping: float) -> Damped:
    """The state at x before its first step."""
    residual = system.residual(p, x)
    return Damped(x=x, residual=residual, cost=0.5 * float(np.vdot(residual, residual).real), damping=damping)
