"""Levenberg-Marquardt for equal amplitudes, the method of the paper (4.2).

With all modes in double precision and phases of zero (`PLAIN`) it is the method as printed. By default its steps are
those in the modes of G above .5 % of the strongest, in single precision, at a fifth of the cost, and the last one is
plain; a frame without a warm start begins at the phases of the first two steps of `Fast`: a dozen iterations from there
give a lower error than fifty from zero. With a guard or quiet terms all steps are plain.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from midair.array_types import Array
from midair.model import Progress, Status
from midair.solvers.damped_step import Form, ModalForm, PlainForm, State
from midair.solvers.fast import Fast
from midair.solvers.modes import modes
from midair.solvers.problem import Answer, Problem, Start, WarmStart


@dataclass(frozen=True, slots=True, kw_only=True)
class LevenbergMarquardt:
    """Settings of "lm"."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "guard", "robust", "quiet-ears", "quiet-palm"})
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
    gradient_tolerance: float = 1e-12
    """Converged when the largest element of the gradient is below this."""
    step_tolerance: float = 1e-9
    """Converged when the length of the step relative to x is below this."""
    cost_tolerance: float = 1e-10
    """Converged when the relative decrease of the cost is below this."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases frame by frame; silent frames keep the phases of the frame before."""
        frames = len(problem.amplitude)
        warm, x = after is not None, np.zeros(problem.transducers + problem.points)
        first = np.broadcast_to(x, (frames, len(x)))
        if after is not None:
            x = after.known
        if self.first == "field" and (self.start == "zero" or not warm):
            first = self._first(problem)
        phase, made, status = np.zeros((frames, problem.transducers)), np.zeros(frames, np.int64), list[Status]()
        forms = self.forms(problem)
        # The diagonal of J^T J by theta is the power of each column of A G, by psi it is p^2.
        largest = float((np.abs(problem.level * problem.G) ** 2).sum(axis=0).max())
        for frame, p in enumerate(problem.amplitude):
            if p.any():
                fresh = self.start == "zero" or not warm
                damping = self.tau * max(largest, float((p**2).max()))
                begin, iterations = (first[frame], self.iterations) if fresh else (x, self.warm_iterations)
                state = self._frame(forms, p, begin, damping, iterations)
                x, warm, made[frame] = state.x, True, state.iterations
                status.append(state.status or "iterations")
            else:
                status.append("silent")
            phase[frame] = x[: problem.transducers]
            if progress is not None:
                progress(frame + 1, frames)
        end = WarmStart(theta=x[: problem.transducers], known=x) if warm else None
        return Answer(phase=phase, iterations=made, status=tuple(status), end=end)

    @property
    def first_moves(self) -> Fast:
        """The solver for the initial phases: `Fast` without its refinement."""
        return Fast(iterations=0, more_iterations=0)

    def forms(self, problem: Problem) -> tuple[Form, Form]:
        """The form of all but the last steps, and that of these; the same one if it is plain."""
        plain = PlainForm(problem=problem)
        if problem.guard is not None or not (self.tolerance > 0 or self.precision == "single"):
            return plain, plain
        return ModalForm.of(modes(problem.G, tolerance=self.tolerance), problem.level, self.precision), plain

    def step(self, form: Form, p: Array, state: State) -> State:
        """Make one iteration: accept a step that lowers the cost, otherwise raise lambda."""
        if np.abs(state.gradient).max() <= self.gradient_tolerance:
            return replace(state, status="converged")
        normal = form.normal(p, state.x) if state.normal is None else state.normal
        state = replace(state, iterations=state.iterations + 1, normal=normal)
        h = form.step(p, state)
        if not np.isfinite(h).all():
            return state.refused()
        if np.linalg.norm(h) <= self.step_tolerance * (np.linalg.norm(state.x) + self.step_tolerance):
            return replace(state, status="converged")
        trial = form.at(p, state.x + h, state.damping)
        # (lambda h - J^T f) . h / 2 is the predicted decrease without another product with J.
        return state.judged(trial, 0.5 * float(h @ (state.damping * h - state.gradient)), self.cost_tolerance)

    def _frame(self, forms: tuple[Form, Form], p: Array, x: Array, damping: float, iterations: int) -> State:
        """Iterate from x on."""
        form, plain = forms
        last = 0 if form is plain else self.last
        state = form.at(p, x, damping)
        while state.status is None and state.iterations < max(iterations - last, 1):
            state = self.step(form, p, state)
        if not last:
            return state
        # Omitted modes and single precision limit the error; the plain step goes below that limit.
        end = plain.at(p, state.x, state.damping)
        for _ in range(min(last, iterations - state.iterations)):
            end = self.step(plain, p, end) if end.status is None else end
        return replace(end, iterations=state.iterations + end.iterations, status=end.status or state.status)

    def _first(self, problem: Problem) -> Array:
        """Initial [theta, psi] of frames without a warm start, shape (frame, transducer + point)."""
        x = np.zeros((len(problem.amplitude), problem.transducers + problem.points))
        alone = np.flatnonzero(problem.amplitude.any(axis=1))
        # With warm starts only the first audible frame is on its own.
        alone = alone if self.start == "zero" else alone[:1]
        if len(alone):
            some = replace(problem, amplitude=problem.amplitude[alone])
            theta = self.first_moves.solve(some).phase
            x[alone] = np.hstack([theta, np.where(some.amplitude > 0, np.angle(some.field(theta)), 0.0)])
        return x


PLAIN = LevenbergMarquardt(iterations=50, first="zero", tolerance=0.0, precision="double")
"""The method as printed in the paper, in the settings of the textbook where the paper gives none."""
