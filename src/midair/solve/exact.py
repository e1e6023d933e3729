"""The paper's Levenberg-Marquardt steps at a tenth of their price.

Three savings, none of which changes the step:

1. psi leaves the system. Each psi_m touches one point only, so that J_psi J_psi^T + lambda I is a 2 x 2 block a point
   with a known inverse; with v = -j u the direction in which psi turns p u, and weights w = p^2 / (lambda + p^2),
   lambda (J_psi J_psi^T + lambda I)^-1 f = f - w v (v . f).
2. G = U diag(s) V^H. Residuals that no drive can change need no equations: 2 r unknowns z = U^H y remain,
   (lambda I + (I - Q) K) z = U^H (f - w v (v . f)), with K = B B^T of the rows of B = A diag(s) V^H diag(exp j theta)
   and Q = F^T F of the rows sqrt(w_m) v_m . U_m.
3. Half of K is known: B B^H = A^2 diag(s^2), whatever the phases are.

Then h_theta = -B^T z, and h_psi is the best psi for that: -p / (lambda + p^2) v . (f - U K z).
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Status
from midair.solve.levenberg_marquardt import LevenbergMarquardt, damped
from midair.solve.modes import Modes, modes
from midair.solve.problem import Answer, Problem, Progress, Start
from midair.solve.sequence import FrameAnswer, solve_in_turn

Array = NDArray[np.floating[Any]]
Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exact:
    """Settings; `tolerance=0, precision="double"` takes the very steps of `LevenbergMarquardt`.

    Attributes
    ----------
    iterations, warm_iterations : int
        At most, for a frame that starts at zero, and for one that starts at the previous.
    start : {"previous", "zero"}
        Of every frame after the first.
    tau : float
        First lambda over the largest diagonal element of J^T J.
    tolerance : float
        Modes of G below this part of the largest singular value are left out, except from the last steps.
    precision : {"single", "double"}
        Of all but the last steps.
    last : int
        Steps at the end with all modes in double precision.
    step_tolerance, cost_tolerance : float
        Converged when the step relative to x, or the relative fall of the cost, is below.
    """

    iterations: int = 50
    warm_iterations: int = 20
    start: Start = "previous"
    tau: float = 1e-3
    tolerance: float = 5e-3
    precision: Literal["single", "double"] = "single"
    last: int = 1
    step_tolerance: float = 1e-9
    cost_tolerance: float = 1e-10

    def solve(self, problem: Problem, *, progress: Progress | None = None) -> Answer:
        """Phases for each frame, one after another."""
        system = System.of(modes(problem.G, tolerance=self.tolerance), problem.level, self.precision)
        last = self.last if self.precision == "single" or self.tolerance > 0 else 0
        diagonal = float(((np.abs(problem.G) * problem.level) ** 2).sum(axis=0).max())
        plain = LevenbergMarquardt()

        def one(p: NDArray[np.float64], x: NDArray[np.float64], iterations: int) -> FrameAnswer:
            state = State.at(system, p, x, self.tau * max(diagonal, float((p**2).max())))
            while state.status is None and state.iterations < max(iterations - last, 1):
                state = self.step(system, p, state)
            end = replace(plain.begin(problem, p, state.x), damping=state.damping)
            for _ in range(min(last, iterations - state.iterations)):
                end = plain.step(problem, p, end) if end.status is None else end
            made = state.iterations + end.iterations
            return FrameAnswer(x=end.x, iterations=made, status=end.status or state.status or "iterations")

        return solve_in_turn(
            problem, one, iterations=(self.iterations, self.warm_iterations), start=self.start, progress=progress
        )

    def step(self, system: "System", p: Array, state: "State") -> "State":
        """One iteration: a step that lowers the cost is taken, any other raises lambda."""
        state = replace(state, iterations=state.iterations + 1)
        h = system.step(p, state)
        gradient = system.gradient(p, state)
        if not np.isfinite(h).all():
            return state.refused()
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        trial = State.at(system, p, state.x + h, state.damping)
        fall = state.cost - trial.cost
        promised = 0.5 * float(h @ (state.damping * h - gradient))
        gain = fall / promised if promised > 0 else -1.0
        if not gain > 0:
            return state.refused()
        done = fall <= self.cost_tolerance * state.cost
        return replace(
            trial,
            damping=damped(state.damping, gain),
            iterations=state.iterations,
            status="converged" if done else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Where one frame stands; as in `levenberg_marquardt.State`, without what the system keeps.

    Attributes
    ----------
    x : ndarray, shape (transducer + point,)
        [theta, psi], in rad.
    residual : ndarray of complex, shape (point,)
        G q - diag(p) u.
    cost, damping, growth : float
        || f ||^2 / 2; lambda; what lambda is multiplied with when a step fails.
    iterations : int
        Made so far.
    status : str or None
        How it ended.
    """

    x: NDArray[np.float64]
    residual: Complex
    cost: float
    damping: float
    growth: float = 2.0
    iterations: int = 0
    status: Status | None = None

    @classmethod
    def at(cls, system: "System", p: Array, x: NDArray[np.float64], damping: float) -> "State":
        """The state of x before its first step."""
        residual = system.residual(p, x)
        return cls(x=x, residual=residual, cost=0.5 * float(np.vdot(residual, residual).real), damping=damping)

    def refused(self) -> "State":
        """The same place with more damping; stalled once lambda is beyond any step that could matter."""
        worse = self.damping * self.growth
        return replace(self, damping=worse, growth=2 * self.growth, status="stalled" if worse > 1e12 else None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class System:
    """The factor of one G in one precision, and the damped step with it.

    Attributes
    ----------
    U : ndarray of complex, shape (point, mode)
        Orthonormal fields.
    C : ndarray of complex, shape (mode, transducer)
        A diag(s) V^H.
    power : ndarray, shape (mode,)
        (A s)^2.
    """

    U: Complex
    C: Complex
    power: Array

    @classmethod
    def of(cls, kept: Modes, level: float, precision: str) -> "System":
        """From the modes of G and A."""
        kind = np.complex64 if precision == "single" else np.complex128
        C = (level * kept.s)[:, None] * kept.V.conj().T
        power = np.asarray((level * kept.s) ** 2, np.float32 if precision == "single" else np.float64)
        return cls(U=kept.U.astype(kind), C=np.ascontiguousarray(C, kind), power=power)

    def residual(self, p: Array, x: NDArray[np.float64]) -> Complex:
        """G q - diag(p) u, shape (point,)."""
        wave = np.exp(1j * x)
        count = self.C.shape[1]
        return self.U @ (self.C @ wave[:count].astype(self.C.dtype)) - p * wave[count:]

    def gradient(self, p: Array, state: State) -> NDArray[np.float64]:
        """J^T f, shape (transducer + point,)."""
        count = self.C.shape[1]
        wave = np.exp(1j * state.x)
        heard = (state.residual.conj().astype(self.C.dtype) @ self.U) @ self.C
        return np.concatenate([-(wave[:count] * heard).imag, -p * (wave[count:].conj() * state.residual).imag])

    def step(self, p: Array, state: State) -> NDArray[np.float64]:
        """The damped Gauss-Newton step h, shape (transducer + point,), in rad; not finite if lambda is too small."""
        count, r = self.C.shape[1], len(self.power)
        u = np.exp(1j * state.x[count:])
        wave = np.exp(1j * state.x[:count]).astype(self.C.dtype)
        B = self._turned(wave)
        K = self._normal(B)
        stiff = state.damping + p**2
        w = p**2 / stiff
        # v . y of complex y is Re(conj(v) y) = -Im(conj(u) y), with v = -j u.
        along = -(u.conj() * state.residual).imag
        b = ((state.residual - w * along * (-1j * u)).astype(self.C.dtype).conj() @ self.U).conj()
        seen = np.sqrt(w)[:, None] * (1j * u.conj())[:, None]
        F = seen.astype(self.C.dtype) * self.U
        rows = np.concatenate([F.real, -F.imag], axis=1)
        # Transposed, K - K Q, which is lambda I + (I - Q) K in the order of axes that LAPACK wants.
        transposed = K - K @ (rows.T @ rows)
        transposed[np.diag_indices(2 * r)] += state.damping
        z = self._solved(transposed.T, np.concatenate([b.real, b.imag]))
        k = K @ z
        left = state.residual - self.U @ (k[:r] + 1j * k[r:])
        h_psi = p / stiff * (u.conj() * left).imag
        return np.concatenate([-(z @ B), h_psi])

    def _solved(self, matrix: Array, right: Array) -> Array:
        """X of matrix x = right, shape (2 mode,); NaN if the matrix is singular."""
        from scipy.linalg import lapack

        gesv = lapack.sgesv if matrix.dtype == np.float32 else lapack.dgesv
        _, _, x, info = gesv(matrix, right, overwrite_a=True, overwrite_b=True)
        return np.asarray(x) if info == 0 else np.full_like(right, np.nan)

    def _turned(self, wave: Complex) -> Array:
        """The real rows of j A diag(s) V^H diag(exp j theta): shape (2 mode, transducer)."""
        B = self.C * wave
        return np.concatenate([-B.imag, B.real])

    def _normal(self, B: Array) -> Array:
        """B B^T from two of its three blocks, shape (2 mode, 2 mode): the diagonal ones add up to (A s)^2."""
        r = len(self.power)
        minus, real = B[:r], B[r:]
        K = np.empty((2 * r, 2 * r), B.dtype)
        K[r:, r:] = real @ real.T
        K[:r, :r] = np.diag(self.power) - K[r:, r:]
        K[r:, :r] = real @ minus.T
        K[:r, r:] = K[r:, :r].T
        return K
