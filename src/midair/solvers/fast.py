"""Many frames at once, in three moves that are nothing but matrix products.

1. The field: of all fields that the array could make if its transducers were free in amplitude, the one closest to the
   target. Unknowns are the r coordinates of the field, a seventh of the transducers, so that this is cheap; drives
   louder than full cost extra.
2. The lift: phases whose field is that one. Alternating projections between the drives that make the field and the
   drives that are equally loud, with over-relaxation.
3. The polish: the error itself as a function of the phases alone. At the best psi, || G q - diag(p) u || is
   || |G q| - p ||, so that psi needs no unknowns.

Moves 1 and 3 are L-BFGS on batches; `moves` has them all. How this was chosen, and what lost:
docs/decisions/0004-solvers.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress
from midair.solvers.backend import Rows, backend
from midair.solvers.field_operators import Batch, FieldOperators
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, Problem, WarmStart, status_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Fast:
    """Settings of the batch solver.

    Attributes
    ----------
    iterations : int
        Iterations of the polish; five times as many where changes of phase count (`Problem.smooth`) and all frames of
        a batch are polished together.
    more_iterations : int
        Iterations that the worst quarter of a batch gets on top, where frames are on their own.
    field_iterations, lift_iterations : int
        Iterations of the first and the second move.
    tolerance : float
        Modes of G below this part of the largest singular value are left out of the iterations; the error that is
        reported is that of the whole G.
    loudness : float
        Weight of drives above full in the first move.
    floor : float
        Modes below this part of the largest singular value are asked for less in the first field.
    every : int
        One transducer in so many is looked at for loudness: a drive made of r modes is smooth.
    relaxation : float
        Over-relaxation of the projections, 1 to 2.
    batch : int, optional
        Frames at once: large enough for matrix products, small enough for the cache. What suits the backend if None.
    memory : int
        Pairs that L-BFGS keeps.
    faintest : float
        Norm of a target, in units of the focus, below which it counts as this faint: the range of single precision.
    precision : {"single", "double"}
        Precision of the iterations. Rounding of single precision is a thousandth of the smallest error seen.
    backend : str
        What does the arithmetic, and where: see `backend.backend`. The modes are always worked out by NumPy.
    """

    iterations: int = 40
    more_iterations: int = 100
    field_iterations: int = 110
    lift_iterations: int = 10
    tolerance: float = 5e-3
    loudness: float = 0.0075
    floor: float = 0.1
    every: int = 4
    relaxation: float = 1.5
    batch: int | None = None
    memory: int = 4
    faintest: float = 1e-12
    precision: Literal["single", "double"] = "single"
    backend: str = "numpy"

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Phases for each frame; silent ones keep those of the frame before them.

        The iterations that are reported are those of all three moves, without what the worst quarter gets on top.

        Raises
        ------
        InputError
            If the backend is unknown.
        MissingExtraError
            If it is not installed.
        """
        there = backend(self.backend, precision=self.precision)
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.zeros((len(problem.amplitude), problem.transducers))
        made = np.zeros(len(phase), np.int64)
        if len(audible):
            with there.at_work():
                machine = FieldOperators.of(problem, there, tolerance=self.tolerance, memory=self.memory)
                self._fill(phase, machine, audible, after, progress)
            made[audible] = self._iterations(problem)
            if progress is not None:
                progress(len(phase), len(phase))
        end = WarmStart(theta=phase[audible[-1]]) if len(audible) else after
        held = hold(phase, audible, None if after is None else after.theta)
        return Answer(phase=held, iterations=made, status=status_of(len(phase), audible), end=end)

    def _fill(
        self,
        phase: NDArray[np.float64],
        machine: FieldOperators,
        audible: NDArray[np.int64],
        after: WarmStart | None,
        progress: Progress | None,
    ) -> None:
        """Phases of the audible frames, batch by batch."""
        there = machine.backend
        # Before the first frame nothing sounds: a drive of 0 pulls no phase.
        before = there.xp.zeros_like(machine.lens)
        if after is not None:
            before = there.phasor(there.put(after.theta[None]))
        for some in _batches(audible, self.batch or there.rows):
            theta = self._phases(machine, machine.batch(some, faintest=self.faintest), before)
            phase[some], before = there.get(theta), there.phasor(theta[-1:, :])
            if progress is not None:
                progress(int(some[-1]) + 1, len(phase))

    def _phases(self, machine: FieldOperators, batch: Batch, before: Rows) -> Rows:
        """The three moves for some frames: phases (row, transducer), in rad."""
        field = machine.best_field(
            batch, self.field_iterations, loudness=self.loudness, floor=self.floor, every=self.every
        )
        theta = machine.lift(field, self.lift_iterations, relaxation=self.relaxation)
        if machine.problem.smooth > 0:
            # Tied frames converge together, and the worst of them cannot be given more on its own.
            return machine.together(theta, batch, before, 5 * self.iterations)
        return machine.polish(theta, batch, self.iterations, more=self.more_iterations)

    def _iterations(self, problem: Problem) -> int:
        polish = 5 * self.iterations if problem.smooth > 0 else self.iterations
        return self.field_iterations + self.lift_iterations + polish


def _batches(audible: NDArray[np.int64], size: int) -> Iterator[NDArray[np.int64]]:
    for first in range(0, len(audible), size):
        yield audible[first : first + size]
