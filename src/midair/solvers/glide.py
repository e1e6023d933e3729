"""Solve a whole recording by bisection in time.

Marks, frames at regular distances, are solved from scratch like in the batch solver. Then come the frames halfway
between solved frames, level by level: each starts at the mean of the two drives around it and needs only some
iterations of refinement. All frames of a level are one batch, and there are no discontinuities between batches. Phases
change little from frame to frame, which matters more than a smaller error.

Frames whose target differs from the mean of their neighbours first get a field and phases of their own.
docs/decisions/0024-glide.md compares the alternatives.
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Progress
from midair.solvers.backend import Backend, backend
from midair.solvers.bisection_step import BisectionStep, Effort
from midair.solvers.field_operators import FieldOperators
from midair.solvers.glide_blocks import BlockRange, FrameBlock, Indices, SolvedFrames, blocks, solve_marks
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, Problem, WarmStart, status_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Glide:
    """Settings of the recording solver; the defaults suit 1 kHz, those of the best mode 4 kHz."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "cells", "guard", "robust", "quiet-ears", "quiet-palm"})
    """Names of the terms that it supports besides the error of the paper."""

    coarse: int = 32
    """Frames from one mark to the next."""
    cold: Effort = (110, 10, 100)
    """Iterations of field step, phase fit and refinement of a mark."""
    near: float = 0.1
    """Error of the neighbours' mean up to which a refinement is enough."""
    smooth: int = 10
    """Iterations of that refinement."""
    smooth_wide: int = 40
    """The same where the neighbours are at least `wide` frames away, since all frames between build on them."""
    far: float = 0.3
    """Largest relative difference of a target from its neighbours' mean for a bent frame; above it is rough."""
    bent: Effort = (7, 9, 8)
    """Iterations of field step, phase fit and refinement of bent frames."""
    bent_wide: Effort = (15, 9, 60)
    """The same where the neighbours are at least `wide` frames away."""
    rough: Effort = (80, 9, 10)
    """Iterations of field step, phase fit and refinement of rough frames."""
    wide: int = 8
    """Distance in frames between neighbours, see `smooth_wide`."""
    split: int = 10
    """Iterations of ADMM between phase fit and refinement of rough frames."""
    stiffness: float = 0.05
    """Penalty of ADMM, relative to the strongest mode."""
    hardest: float = 0.55
    """Fraction of the array's power, needed for a field, above which `hard_polish` replaces ADMM."""
    hard_polish: int = 40
    """Iterations of the refinement of such frames."""
    bad: float = 0.012
    """Error of a frame above which the worst frames of a batch, at most one in eight, are refined further: on an array
    that is folded by its mirrors, where single frames would otherwise end at a larger error.
    """
    rescue: int = 12
    """Iterations of that refinement."""
    towards: float = 0.2
    """Weight, relative to the peak, of an even field in the phases of the new part of a target."""
    # With 5e-3, as in the batch solver, the omitted modes would limit the error.
    tolerance: float = 2e-3
    """Modes of G below this fraction of the largest singular value are left out, except from the reported error."""
    outside: float = 0.3
    """Weight of a guard point relative to a control point in the choice of modes."""
    loudness: float = 0.1
    """Weight of the penalty on amplitudes above full drive, in the field step."""
    every: int = 4
    """The penalty looks at one in this many transducers, evenly spread over the array."""
    floor: float = 0.1
    """Modes below this fraction of the largest singular value are damped in the initial field."""
    step: float = 2.0
    """Step size of the heavy-ball phase fit, as in `Live`."""
    momentum: float = 0.3
    """Momentum of the heavy-ball phase fit, as in `Live`."""
    relaxation: float = 1.5
    """Over-relaxation of the projections, 1 to 2."""
    memory: int = 4
    """Number of pairs that L-BFGS keeps."""
    rows: int | None = None
    """Frames per batch; if None, the backend decides."""
    block: int | None = None
    """Frames per block, solved by one job; other blocks only share a mark with it. If None, see `block_on`."""
    opening: int = 256
    """Frames of the first block, which is short so that its frames are there early."""
    jobs: int = field(default=1, compare=False)
    """Number of blocks solved at once; the phases are bit-identical for any number."""
    faintest: float = 1e-12
    """As in `Fast`."""
    precision: Literal["single", "double"] = "single"
    """Precision of the iterations."""
    backend: str = "numpy"
    """Array library and device, see `backend.backend`."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases for each frame; silent frames keep the phases of the frame before.

        With `after`, the problem's first frame must be the last sounding frame of the previous part, a mark that is
        solved already.

        Raises InputError if the backend is unknown or `jobs` is below 1; MissingExtraError if it is not installed.
        """
        if self.jobs < 1:
            raise InputError(f"jobs: expected 1 or more, got {self.jobs}")
        array_backend = backend(self.backend, precision=self.precision)
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.zeros((len(problem.amplitude), problem.transducers))
        made = np.zeros(len(phase), np.int64)
        if after is not None:
            phase[audible[:1]] = after.theta
        if len(audible) > (after is not None):
            with array_backend.at_work():
                bisection = self._bisection(problem, array_backend)
                last = None if after is None else after.known
                for frames, found in self._solved_blocks(bisection, audible, last):
                    last = found.last()
                    phase[frames], made[frames] = found.theta, found.iterations
                    if progress is not None:
                        progress(int(frames[-1]) + 1, len(phase))
            if progress is not None:
                # Frames after the last audible one need no work.
                progress(len(phase), len(phase))
            after = WarmStart(theta=phase[audible[-1]], known=last)
        held = hold(phase, audible)
        return Answer(phase=held, iterations=made, status=status_of(len(phase), audible), end=after)

    def _solved_blocks(
        self, bisection: BisectionStep, audible: Indices, before: SolvedFrames | None
    ) -> Iterator[tuple[Indices, SolvedFrames]]:
        """Yield frames and solutions of each block in order; `before` is the solution of the first frame, if known."""
        opening = self.opening if before is None else 0
        every = list(blocks(len(audible), coarse=self.coarse, size=self.block_on(), opening=opening))
        if before is not None:
            every[0] = replace(every[0], marks=every[0].marks[every[0].marks > 0])
        with ThreadPoolExecutor(self.jobs) as pool:
            marks = deque(
                pool.submit(_without_warnings, solve_marks, bisection, audible[block.marks]) for block in every
            )
            walks: deque[Future[SolvedFrames]] = deque()
            for block in every:
                found = marks.popleft().result()
                frames = audible[block.first : block.last + 1]
                walks.append(pool.submit(_without_warnings, _solve_block, bisection, frames, block, before, found))
                before = found.last()
            for block in every:
                yield audible[block.first : block.last + 1], walks.popleft().result()

    def block_on(self) -> int:
        """Frames per block: 1024 on a CPU; on a GPU enough that the marks of one block fill a batch."""
        return self.block or (32 * 1024 if backend(self.backend).on_gpu else 1024)

    def _bisection(self, problem: Problem, array_backend: Backend) -> BisectionStep:
        operators = FieldOperators.of(
            problem, array_backend, tolerance=self.tolerance, memory=self.memory, outside=self.outside
        )
        columns = problem.transducers // operators.drive.images
        position = None if problem.position is None else problem.position[:columns]
        sampled = evenly_spread(position, every=self.every, count=columns)
        return BisectionStep(
            operators=operators,
            field=operators.field_move(loudness=self.loudness, floor=self.floor, sampled=sampled),
            settings=self,
        )


def evenly_spread(position: NDArray[np.float64] | None, *, every: int, count: int) -> Indices:
    """Indices of one in `every` transducers, evenly over the array: each next is the farthest from those before it.

    If the positions are unknown, every `every`-th.
    """
    if position is None:
        return np.arange(0, count, every)
    chosen = [int(position[:, :2].sum(axis=1).argmin())]
    distance = np.full(count, np.inf)
    while len(chosen) < max(count // every, 1):
        distance = np.minimum(distance, ((position - position[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distance.argmax()))
    return np.sort(np.array(chosen))


def _solve_block(
    bisection: BisectionStep, frames: Indices, block: BlockRange, before: SolvedFrames | None, marks: SolvedFrames
) -> SolvedFrames:
    """Solve all frames of a block, from its marks and the last mark of the block before it."""
    block_frames, index = FrameBlock(bisection, frames), block.marks - block.first
    block_frames.known.put(index, marks)
    if before is not None:
        block_frames.known.put(np.zeros(1, np.int64), before)
        index = np.concatenate([[0], index])
    block_frames.solve(index)
    return block_frames.known


def _without_warnings(work: Callable[..., SolvedFrames], *arguments: Any) -> SolvedFrames:
    """Call `work` without NumPy's overflow warnings, which are set per thread; a step that overflows is rejected."""
    with np.errstate(over="ignore", invalid="ignore"):
        return work(*arguments)
