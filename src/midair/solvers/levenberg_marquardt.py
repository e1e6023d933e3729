"""The paper's Levenberg-Marquardt method for equal amplitudes (paper, 4.2).

Each step solves (J^T J + lambda I) h = -J^T f. The print has lost the J^T in front of f; without it the sizes do not
fit. There are more unknowns than residuals (N + M = 1252, 2M = 512), so the step is taken in its dual form
h = -J^T (J J^T + lambda I)^-1 f, which is the same by the push-through identity. The damping lambda follows the gain
ratio, and the stops are those of Madsen, Nielsen & Tingleff, "Methods for non-linear least squares problems"
(2004), section 3.2.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress, Status
from midair.solvers.problem import Answer, Problem, Start, WarmStart, jacobian, residual
from midair.solvers.sequence import FrameAnswer, solve_in_turn
from midair.solvers.terms import excess_rows

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Where the iteration of one frame stands.

    Attributes
    ----------
    x : ndarray, shape (transducer + point,)
        [theta, psi], in rad.
    residual : ndarray of complex, shape (point,)
        G q - diag(p) u at x.
    gradient : ndarray, shape (transducer + point,)
        J^T f at x.
    cost : float
        || f ||^2 / 2.
    damping : float
        lambda.
    growth : float
        What lambda is multiplied with when a step fails; it doubles with each failure.
    iterations : int
        Made so far, failed steps included.
    status : str or None
        How it ended; None while it goes on.
    normal : ndarray, shape (2 point, 2 point), or None
        J J^T at x, kept over failed steps, without the rows of the guard.
    excess : ndarray, shape (active guard point,)
        Residuals of the guard, `terms.guard.excess_rows`; none without one.
    slope : ndarray, shape (active guard point, transducer)
        Their derivative by theta.
    """

    x: Array
    residual: Complex
    gradient: Array
    cost: float
    damping: float
    growth: float = 2.0
    iterations: int = 0
    status: Status | None = None
    normal: Array | None = None
    excess: Array = field(default_factory=lambda: np.zeros(0))
    slope: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class LevenbergMarquardt:
    """Settings of the method; the defaults are the paper's, and for what it does not say, the textbook's.

    Attributes
    ----------
    iterations : int
        Largest number of iterations for a frame that starts at zero.
    warm_iterations : int
        Largest number of iterations for a frame that starts at the previous one.
    start : {"previous", "zero"}
        Start of every frame after the first.
    tau : float
        First lambda over the largest diagonal element of J^T J.
    form : {"dual", "primal"}
        Size of the system that is solved: 2M or N + M. The steps are the same; the primal form is the reference.
    gradient_tolerance, step_tolerance, cost_tolerance : float
        Converged when the largest gradient, the step's length relative to x, or the relative fall of the cost is
        below.
    """

    iterations: int = 50
    warm_iterations: int = 20
    start: Start = "previous"
    tau: float = 1e-3
    form: Literal["dual", "primal"] = "dual"
    gradient_tolerance: float = 1e-12
    step_tolerance: float = 1e-9
    cost_tolerance: float = 1e-10

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Phases for each frame, one after another."""

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
        """One iteration: a step that lowers the cost is taken, any other raises lambda."""
        if np.abs(state.gradient).max() <= self.gradient_tolerance:
            return replace(state, status="converged")
        state = replace(state, iterations=state.iterations + 1)
        if self.form == "dual" and state.normal is None:
            state = replace(state, normal=_normal(problem, p, state.x))
        try:
            h = dual_step(problem, p, state) if self.form == "dual" else primal_step(problem, p, state)
        except np.linalg.LinAlgError:
            return _refused(state)
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        return self._judged(problem, p, state, h)

    def _judged(self, problem: Problem, p: Array, state: State, h: Array) -> State:
        """Gain ratio: the fall of the cost over the fall that the linear model promised."""
        trial = _at(problem, p, state.x + h, damping=state.damping)
        fall = state.cost - trial.cost
        # (lambda h - J^T f) . h / 2 is the promised fall without another product with J.
        gain = fall / (0.5 * float(h @ (state.damping * h - state.gradient)))
        # Written so that NaN is refused as well.
        if not gain > 0:
            return _refused(state)
        return replace(
            trial,
            damping=damped(state.damping, gain),
            iterations=state.iterations,
            status="converged" if fall <= self.cost_tolerance * state.cost else None,
        )


def damped(damping: float, gain: float) -> float:
    """The next lambda after a step that was taken, from its gain ratio (Nielsen's rule)."""
    return damping * max(1 / 3, 1 - (2 * gain - 1) ** 3)


def dual_step(problem: Problem, p: Array, state: State) -> Array:
    """The step h = -J^T (J J^T + lambda I)^-1 f, shape (transducer + point,), in rad.

    Raises
    ------
    LinAlgError
        If the matrix is not positive definite in the arithmetic at hand.
    """
    from scipy.linalg import cho_factor, cho_solve

    normal = _normal(problem, p, state.x) if state.normal is None else state.normal
    # A copy, since the factor overwrites it, and a refused step needs J J^T again.
    normal = _bordered(problem, normal, state) if len(state.excess) else normal.copy()
    normal[np.diag_indices_from(normal)] += state.damping
    f = np.concatenate([state.residual.real, state.residual.imag, state.excess])
    # The transpose of a symmetric matrix is the same matrix, in the order of axes that LAPACK wants.
    y = cho_solve(cho_factor(normal.T, lower=True, overwrite_a=True, check_finite=False), f, check_finite=False)
    M = problem.points
    h = -_transposed_jacobian(problem, p, state.x, y[:M] + 1j * y[M : 2 * M])
    if len(state.excess):
        h[: problem.transducers] -= y[2 * M :] @ state.slope
    return h


def primal_step(problem: Problem, p: Array, state: State) -> Array:
    """The step h = -(J^T J + lambda I)^-1 J^T f of the textbook, shape (transducer + point,), in rad; J is dense.

    Raises
    ------
    LinAlgError
        As in `dual_step`.
    """
    from scipy.linalg import cho_factor, cho_solve

    J = jacobian(problem, p, state.x)
    normal = J.T @ J
    if len(state.excess):
        normal[: problem.transducers, : problem.transducers] += state.slope.T @ state.slope
    normal[np.diag_indices_from(normal)] += state.damping
    return -cho_solve(cho_factor(normal, lower=True, overwrite_a=True, check_finite=False), state.gradient)


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


def _bordered(problem: Problem, normal: Array, state: State) -> Array:
    """J J^T with the rows of the guard, shape (2 point + active guard point, the same).

    Of the rows of J by theta, -I and R, with T = A G diag(exp j theta) = R + j I; the guard's do not touch psi.
    """
    turned = problem.level * problem.G * np.exp(1j * state.x[: problem.transducers])
    across = state.slope @ np.concatenate([-turned.imag, turned.real]).T
    return np.block([[normal, across.T], [across, state.slope @ state.slope.T]])


def _at(problem: Problem, p: Array, x: Array, *, damping: float) -> State:
    """The state at x before its first step."""
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


def _refused(state: State) -> State:
    """The same place with more damping; stalled once lambda is beyond any step that could matter."""
    stalled = state.damping * state.growth > 1e12
    return replace(
        state,
        damping=state.damping * state.growth,
        growth=2 * state.growth,
        status="stalled" if stalled else None,
    )
