"""Levenberg-Marquardt of the paper with a smaller linear system and a better start.

The step is that of `LevenbergMarquardt`, computed from the system of `mode_system` at a fifth of the cost. A frame
without a warm start begins at the phases of the first two steps of `Fast`; a dozen iterations from there give a lower
error than fifty from zero.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from midair.array_types import Array
from midair.model import Progress
from midair.solvers.fast import Fast
from midair.solvers.levenberg_marquardt import Damped, LevenbergMarquardt
from midair.solvers.mode_system import System
from midair.solvers.modes import modes
from midair.solvers.problem import Answer, Problem, Start, WarmStart
from midair.solvers.sequence import FrameAnswer, solve_in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Exact:
    """Settings of "exact"; `tolerance=0, precision="double", first="zero"` gives the steps of `LevenbergMarquardt`."""

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
