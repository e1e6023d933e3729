"""Levenberg-Marquardt for equal amplitudes, the method of the paper (4.2).

Each step solves (J^T J + lambda I) h = -J^T f. The paper prints f without J^T, but then the dimensions do not match.
There are more unknowns than residuals (N + M = 1252, 2M = 512), so the dual form h = -J^T (J J^T + lambda I)^-1 f is
solved, which gives the same step by the push-through identity. Damping by gain ratio and stopping criteria: Madsen,
Nielsen & Tingleff, "Methods for non-linear least squares problems" (2004), section 3.2.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.model import Progress, Status
from midair.solvers.problem import Answer, Problem, Start, WarmStart, excess_rows, residual


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameAnswer:
    """Result for one frame: x = [theta, psi], iterations made, and status."""

    x: Array
    iterations: int
    status: Status


FrameSolver = Callable[[Array, Array, int], FrameAnswer]
"""(p, initial x, maximum iterations) -> result for one frame."""


def solve_in_turn(
    problem: Problem,
    one: FrameSolver,
    *,
    iterations: tuple[int, int],
    start: Start,
    first: Array | None = None,
    after: WarmStart | None = None,
    progress: Progress | None = None,
) -> Answer:
    """Solve each frame with `one`; silent frames keep the phases.

    `iterations` are the maxima for a frame without and with a warm start. `first` is the initial x of frames without a
    warm start, shape (frame, transducer + point), zero if None. `after` is the end of the previous part.
    """
    frames = len(problem.amplitude)
    x = np.zeros(problem.transducers + problem.points)
    begin = np.broadcast_to(x, (frames, len(x))) if first is None else first
    phase = np.zeros((frames, problem.transducers))
    made = np.zeros(frames, np.int64)
    status: list[Status] = []
    if after is not None:
        x = after.known
    warm = after is not None
    for frame, p in enumerate(problem.amplitude):
        if p.any():
            fresh = start == "zero" or not warm
            answer = one(p, begin[frame] if fresh else x, iterations[0] if fresh else iterations[1])
            x, warm, made[frame] = answer.x, True, answer.iterations
            status.append(answer.status)
        else:
            status.append("silent")
        phase[frame] = x[: problem.transducers]
        if progress is not None:
            progress(frame + 1, frames)
    end = WarmStart(theta=x[: problem.transducers], known=x) if warm else None
    return Answer(phase=phase, iterations=made, status=tuple(status), end=end)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Damped:
    """State of the damped iteration for one frame."""

    x: Array  # [theta, psi] in rad, shape (transducer + point,)
    residual: NDArray[np.complexfloating[Any, Any]]  # G q - diag(p) u at x, shape (point,)
    cost: float  # || f ||^2 / 2
    damping: float  # lambda
    growth: float = 2.0  # Factor on lambda after a rejected step; it doubles with each one
    iterations: int = 0  # Iterations made, rejected steps included
    status: Status | None = None  # None until the iteration ends
    # J J^T or another matrix of the linear system at x, kept after rejected steps, without the rows of the guard
    normal: NDArray[np.floating[Any]] | None = None

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
class State(Damped):
    """State of "lm" for one frame, with J J^T, shape (2 point, 2 point), as `normal`."""

    gradient: Array  # J^T f at x, shape (transducer + point,)
    # Residuals of the guard, shape (active guard point,), see `terms.guard.excess_rows`
    excess: Array = field(default_factory=lambda: np.zeros(0))
    # Derivative of `excess` by theta, shape (active guard point, transducer)
    slope: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class LevenbergMarquardt:
    """Settings of "lm": the defaults of the paper, and of the textbook for settings that the paper does not give."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "guard", "robust", "quiet-ears", "quiet-palm"})
    """Names of the terms that it supports besides the error of the paper."""

    iterations: int = 50
    """Maximum iterations for a frame that starts at zero."""
    warm_iterations: int = 20
    """Maximum iterations for a frame that starts at the previous one."""
    start: Start = "previous"
    """Start of every frame after the first."""
    tau: float = 1e-3
    """Initial lambda over the largest diagonal element of J^T J."""
    gradient_tolerance: float = 1e-12
    """Converged when the largest element of the gradient is below this."""
    step_tolerance: float = 1e-9
    """Converged when the length of the step relative to x is below this."""
    cost_tolerance: float = 1e-10
    """Converged when the relative decrease of the cost is below this."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases frame by frame."""

        def one(p: Array, x: Array, iterations: int) -> FrameAnswer:
            state = self.begin(problem, p, x)
            while state.status is None and state.iterations < iterations:
                state = self.step(problem, p, state)
            return FrameAnswer(x=state.x, iterations=state.iterations, status=state.status or "iterations")

        return solve_in_turn(
            problem,
            one,
            iterations=(self.iterations, self.warm_iterations),
            start=self.start,
            after=after,
            progress=progress,
        )

    def begin(self, problem: Problem, p: Array, x: Array) -> State:
        """The state before the first step: lambda = tau max diag(J^T J)."""
        # The diagonal by theta is the power of each column of A G, by psi it is p^2.
        largest = max(float((np.abs(problem.level * problem.G) ** 2).sum(axis=0).max()), float((p**2).max()))
        return _at(problem, p, x, damping=self.tau * largest)

    def step(self, problem: Problem, p: Array, state: State) -> State:
        """Make one iteration: accept a step that lowers the cost, otherwise raise lambda."""
        if np.abs(state.gradient).max() <= self.gradient_tolerance:
            return replace(state, status="converged")
        state = replace(state, iterations=state.iterations + 1)
        if state.normal is None:
            state = replace(state, normal=_normal(problem, p, state.x))
        try:
            h = dual_step(problem, p, state)
        except np.linalg.LinAlgError:
            return state.refused()
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        trial = _at(problem, p, state.x + h, damping=state.damping)
        # (lambda h - J^T f) . h / 2 is the predicted decrease without another product with J.
        return state.judged(trial, 0.5 * float(h @ (state.damping * h - state.gradient)), self.cost_tolerance)


def dual_step(problem: Problem, p: Array, state: State) -> Array:
    """The step h = -J^T (J J^T + lambda I)^-1 f, shape (transducer + point,), in rad.

    Raises LinAlgError if the matrix is not positive definite in double precision.
    """
    from scipy.linalg import cho_factor, cho_solve

    normal = _normal(problem, p, state.x) if state.normal is None else state.normal
    # A copy, since the factorisation overwrites it, and J J^T is needed again after a rejected step.
    normal = _bordered(problem, normal, state) if len(state.excess) else normal.copy()
    normal[np.diag_indices_from(normal)] += state.damping
    f = np.concatenate([state.residual.real, state.residual.imag, state.excess])
    # The transpose of a symmetric matrix is the same matrix in Fortran order, as LAPACK expects.
    y = cho_solve(cho_factor(normal.T, lower=True, overwrite_a=True, check_finite=False), f, check_finite=False)
    M = problem.points
    h = -_transposed_jacobian(problem, p, state.x, y[:M] + 1j * y[M : 2 * M])
    if len(state.excess):
        h[: problem.transducers] -= y[2 * M :] @ state.slope
    return h


def _normal(problem: Problem, p: Array, x: Array) -> Array:
    """J J^T, shape (2 point, 2 point).

    With T = A G diag(exp j theta) = R + j I the rows of J by theta are -I and R. R R^T + I I^T = Re(A^2 G G^H) does
    not depend on x, so that two of the three products are enough.
    """
    points = problem.points
    u: Complex = np.exp(1j * x[problem.transducers :])
    turned = problem.level * problem.G * np.exp(1j * x[: problem.transducers])
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


def _transposed_jacobian(problem: Problem, p: Array, x: Array, y: Complex) -> Array:
    """J^T [Re y; Im y] = Re(D^H y), shape (transducer + point,), for complex y of shape (point,)."""
    theta, u = x[: problem.transducers], np.exp(1j * x[problem.transducers :])
    back = (y.conj() @ problem.G).conj()
    return np.concatenate([problem.level * (np.exp(-1j * theta) * back).imag, -(p * u.conj() * y).imag])


def _bordered(problem: Problem, normal: NDArray[np.floating[Any]], state: State) -> NDArray[np.floating[Any]]:
    """J J^T with the rows of the guard, shape (2 point + active guard point, the same).

    The rows of J by theta are -I and R, with T = A G diag(exp j theta) = R + j I; the guard does not depend on psi.
    """
    turned = problem.level * problem.G * np.exp(1j * state.x[: problem.transducers])
    across = state.slope @ np.concatenate([-turned.imag, turned.real]).T
    return np.block([[normal, across.T], [across, state.slope @ state.slope.T]])


def _at(problem: Problem, p: Array, x: Array, *, damping: float) -> State:
    r = residual(problem, p, x)
    state = State(
        x=x,
        residual=r,
        gradient=_transposed_jacobian(problem, p, x, r),
        cost=0.5 * float(np.vdot(r, r).real),
        damping=damping,
    )
    if problem.guard is None:
        return state
    excess, slope = excess_rows(problem.guard, x[: problem.transducers], problem.level, float(p.max()))
    gradient = state.gradient.copy()
    gradient[: problem.transducers] += excess @ slope
    return replace(state, gradient=gradient, cost=state.cost + 0.5 * float(excess @ excess), excess=excess, slope=slope)
