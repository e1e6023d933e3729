"""The paper's Levenberg-Marquardt steps, each at a fifth of its price, and fewer of them.

The step is that of `LevenbergMarquardt`, from the smaller system of `mode_system`. What differs is where a frame that
follows none starts: at the phases of a field that all transducers have a part in (the first two moves of `Fast`),
a dozen steps from a better end than fifty from zero come to.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress, Status
from midair.solvers.fast import Fast
from midair.solvers.levenberg_marquardt import LevenbergMarquardt, damped
from midair.solvers.mode_system import System
from midair.solvers.modes import modes
from midair.solvers.problem import Answer, Problem, Start, WarmStart
from midair.solvers.sequence import FrameAnswer, solve_in_turn

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exact:
    """Settings; `tolerance=0, precision="double", first="zero"` takes the very steps of `LevenbergMarquardt`.

    Attributes
    ----------
    iterations, warm_iterations : int
        Largest number of iterations for a frame on its own, and for one that starts at the previous.
    start : {"previous", "zero"}
        Start of every frame after the first; "zero" treats each frame on its own.
    first : {"field", "zero"}
        Where a frame on its own starts: at the phases that the first two moves of `Fast` give it, or at zero, as in
        the paper, from where some fifty iterations are needed.
    tau : float
        First lambda over the largest diagonal element of J^T J.
    tolerance : float
        Modes of G below this part of the largest singular value are left out, except from the last steps.
    precision : {"single", "double"}
        Precision of all but the last steps.
    last : int
        Steps at the end with all modes in double precision.
    step_tolerance, cost_tolerance : float
        Converged when the step relative to x, or the relative fall of the cost, is below.
    """

    iterations: int = 13
    warm_iterations: int = 20
    start: Start = "previous"
    first: Literal["field", "zero"] = "field"
    tau: float = 1e-3
    tolerance: float = 5e-3
    precision: Literal["single", "double"] = "single"
    last: int = 1
    step_tolerance: float = 1e-9
    cost_tolerance: float = 1e-10

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Phases for each frame, one after another."""
        system = System.of(modes(problem.G, tolerance=self.tolerance), problem.level, self.precision)
        # Left-out modes and single precision set a floor under the error; the plain method's step goes below it.
        last = self.last if self.precision == "single" or self.tolerance > 0 else 0
        # J^T J has these on its diagonal by theta, and p^2 by psi.
        diagonal = float(((np.abs(problem.G) * problem.level) ** 2).sum(axis=0).max())
        plain = LevenbergMarquardt()

        def one(p: Array, x: Array, iterations: int) -> FrameAnswer:
            state = ExactState.at(system, p, x, self.tau * max(diagonal, float((p**2).max())))
            while state.status is None and state.iterations < max(iterations - last, 1):
                state = self.step(system, p, state)
            # With the lambda that the steps have come to, not with a first one.
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
        """The method that gives frames on their own their first phases, in batches of many frames.

        `Fast` without its polish: from there on the steps of this method are better.
        """
        return Fast(iterations=0, more_iterations=0)

    def step(self, system: System, p: Array, state: "ExactState") -> "ExactState":
        """One iteration: a step that lowers the cost is taken, any other raises lambda."""
        K = system.normal(state.x) if state.normal is None else state.normal
        state = replace(state, iterations=state.iterations + 1, normal=K)
        h = system.step(p, state.x, state.residual, state.damping, K)
        if not np.isfinite(h).all():
            return state.refused()
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        trial = ExactState.at(system, p, state.x + h, state.damping)
        fall = state.cost - trial.cost
        promised = 0.5 * float(h @ (state.damping * h - system.gradient(p, state.x, state.residual)))
        # An exact step always promises a fall; one spoilt by rounding may not, and is refused.
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

    def _first(self, problem: Problem) -> Array | None:
        """[theta, psi] that each frame on its own starts from, shape (frame, transducer + point); None for zero.

        Only the frames that will be asked for are worked out; the rows of the others are zero.
        """
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExactState:
    """Where one frame stands; as in `levenberg_marquardt.State`, with what `mode_system` needs.

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
    normal : ndarray, shape (2 mode, 2 mode), or None
        K at x, kept over failed steps.
    """

    x: Array
    residual: NDArray[np.complexfloating[Any, Any]]
    cost: float
    damping: float
    growth: float = 2.0
    iterations: int = 0
    status: Status | None = None
    normal: NDArray[np.floating[Any]] | None = None

    @classmethod
    def at(cls, system: System, p: Array, x: Array, damping: float) -> "ExactState":
        """The state of x before its first step."""
        residual = system.residual(p, x)
        return cls(x=x, residual=residual, cost=0.5 * float(np.vdot(residual, residual).real), damping=damping)

    def refused(self) -> "ExactState":
        """The same place with more damping; stalled once lambda is beyond any step that could matter."""
        worse = self.damping * self.growth
        return replace(self, damping=worse, growth=2 * self.growth, status="stalled" if worse > 1e12 else None)
