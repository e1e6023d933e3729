"""Solve many frames at once, in three steps that consist of matrix products.

1. Field: minimise the error over drives with free amplitudes, with a penalty on amplitudes above full drive. The
   unknowns are the r mode coordinates of the field, a seventh of the number of transducers.
2. Phase fit: find phases at equal amplitude that make this field, by alternating projections with over-relaxation.
3. Refinement: minimise the error as a function of the phases alone. At the best psi, || G q - diag(p) u || is || |G q|
   - p ||, so psi is not an unknown.

Steps 1 and 3 are L-BFGS on batches. `field_operators` contains all steps; docs/decisions/0004-solvers.md compares the
alternatives.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress
from midair.solvers.backend import Rows, backend
from midair.solvers.field_operators import Batch, FieldOperators
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, Problem, WarmStart, status_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Fast:
    """Settings of the batch solver."""

    terms: ClassVar[frozenset[str]] = frozenset(
        {"amplitudes", "cells", "guard", "robust", "smooth", "quiet-ears", "quiet-palm"}
    )
    """Names of the terms that it supports besides the error of the paper."""

    iterations: int = 40
    """Iterations of the refinement; five times as many with `Problem.smooth`, which refine a batch as a whole."""
    more_iterations: int = 100
    """Additional iterations for the worst quarter of a batch, where frames are independent."""
    field_iterations: int = 110
    """Iterations of the field step."""
    lift_iterations: int = 10
    """Iterations of the phase fit."""
    tolerance: float = 5e-3
    """Modes of G below this fraction of the largest singular value are left out, except from the reported error."""
    loudness: float = 0.0075
    """Weight of the penalty on amplitudes above full drive, in the field step."""
    floor: float = 0.1
    """Modes below this fraction of the largest singular value are damped in the initial field."""
    every: int = 4
    """The penalty looks at one in this many transducers: a drive of r modes is smooth."""
    relaxation: float = 1.5
    """Over-relaxation of the projections, 1 to 2."""
    batch: int | None = None
    """Frames per batch: large enough for matrix products, small enough for the cache. If None, the backend decides."""
    memory: int = 4
    """Number of pairs that L-BFGS keeps."""
    faintest: float = 1e-12
    """Smallest norm of a target, in units of the focus, that single precision can represent; others are raised to
    it.
    """
    precision: Literal["single", "double"] = "single"
    """Precision of the iterations. Rounding in single precision is a thousandth of the smallest error seen."""
    backend: str = "numpy"
    """Array library and device, see `backend.backend`. NumPy always computes the modes."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases for each frame; silent frames keep the phases of the frame before.

        The reported iterations are those of all three steps, without the additional ones for the worst quarter.
        """
        array_backend = backend(self.backend, precision=self.precision)
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.zeros((len(problem.amplitude), problem.transducers))
        made = np.zeros(len(phase), np.int64)
        if len(audible):
            with array_backend.at_work():
                operators = FieldOperators.of(problem, array_backend, tolerance=self.tolerance, memory=self.memory)
                self._fill(phase, operators, audible, after, progress)
            made[audible] = self._iterations(problem)
            if progress is not None:
                progress(len(phase), len(phase))
        end = WarmStart(theta=phase[audible[-1]]) if len(audible) else after
        held = hold(phase, audible, None if after is None else after.theta)
        return Answer(phase=held, iterations=made, status=status_of(len(phase), audible), end=end)

    def _fill(
        self,
        phase: NDArray[np.float64],
        operators: FieldOperators,
        audible: NDArray[np.int64],
        after: WarmStart | None,
        progress: Progress | None,
    ) -> None:
        """Solve the audible frames, batch by batch, into `phase`."""
        array_backend = operators.backend
        # There is no frame before the first: a drive of 0 has no effect on the phases.
        before = array_backend.xp.zeros_like(operators.initial_drive)
        if after is not None:
            before = array_backend.phasor(array_backend.put(after.theta[None]))
        for some in array_backend.batches(audible, self.batch):
            theta = self._phases(operators, operators.batch(some, faintest=self.faintest), before)
            phase[some], before = array_backend.get(theta), array_backend.phasor(theta[-1:, :])
            if progress is not None:
                progress(int(some[-1]) + 1, len(phase))

    def _phases(self, operators: FieldOperators, batch: Batch, before: Rows) -> Rows:
        """The three steps for some frames: phases (row, transducer), in rad."""
        field = operators.best_field(
            batch, self.field_iterations, loudness=self.loudness, floor=self.floor, every=self.every
        )
        theta = operators.phase_fit(field, self.lift_iterations, relaxation=self.relaxation)
        if operators.problem.smooth:
            # Coupled frames converge together, so the worst quarter cannot get iterations of its own.
            return operators.refine_together(theta, batch, before, 5 * self.iterations)
        return operators.refine(theta, batch, self.iterations, more=self.more_iterations)

    def _iterations(self, problem: Problem) -> int:
        refinement = 5 * self.iterations if problem.smooth else self.iterations
        return self.field_iterations + self.lift_iterations + refinement
