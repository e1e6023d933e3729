"""Solve a whole recording by bisection in time.

Marks, frames at regular distances, are solved from scratch like in the batch solver. Then come the frames halfway
between solved frames, level by level: each starts at the mean of the two drives around it and needs only some
iterations of refinement. All frames of a level are one batch, and there are no discontinuities between batches. Phases
change little from frame to frame, which matters more than a smaller error. Frames whose target differs from the mean of
their neighbours first get a field and phases of their own.

Marks are counted from the first sounding frame, and a block is a fixed number of marks, so that batches do not depend
on the length of the recording or on the number of jobs. docs/decisions/0024-glide.md compares the alternatives.
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import Progress
from midair.solvers.backend import backend, taken
from midair.solvers.bisection_step import BisectionStep, Effort, Indices, Neighbours, SolvedFrames, StepSettings
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, Problem, WarmStart, status_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockRange:
    """Frames `first` to `last`, both included; `first` is the last frame of the previous block, if there is one."""

    first: int
    last: int
    marks: Indices  # Frames that are solved from scratch, shape (mark,), `first` only in the first block

    @property
    def leads(self) -> bool:
        """Whether this is the first block."""
        return self.first == int(self.marks[0])


def frames_in_block(coarse: int, size: int) -> int:
    """Frames of a block: `size` rounded up to whole distances between marks."""
    return coarse * max(-(-size // coarse), 1)


def blocks(frames: int, *, coarse: int, size: int, opening: int = 0) -> Iterator[BlockRange]:
    """Yield all blocks of this number of sounding frames, in order.

    `coarse` is the distance between marks (the last frame is a mark, too), `size` the frames of a block, rounded up to
    whole distances, and `opening` those of the first one where it is shorter.
    """
    size = frames_in_block(coarse, size)
    begin = min(opening, size) if opening else size
    for first in [0, *range(begin, max(frames - 1, 1), size)]:
        last = min(first + (size if first else begin), frames - 1)
        start = first if first == 0 else first + coarse
        marks = np.unique(np.minimum(np.arange(start, last + coarse, coarse), last))
        yield BlockRange(first=first, last=last, marks=marks)


def midpoints(marks: Indices) -> Iterator[Indices]:
    """Frames between the marks, level by level: rows (before, middle, after), where the outer two are solved."""
    pairs = np.stack([marks[:-1], marks[1:]], axis=1)
    while len(pairs := pairs[pairs[:, 1] - pairs[:, 0] > 1]):
        middle = pairs.sum(axis=1) // 2
        yield np.stack([pairs[:, 0], middle, pairs[:, 1]], axis=1)
        pairs = np.stack([pairs[:, 0], middle, middle, pairs[:, 1]], axis=1).reshape(-1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Glide(StepSettings):
    """Settings of the recording solver."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "cells", "guard", "robust", "quiet-ears", "quiet-palm"})
    """Names of the terms that it supports besides the error of the paper."""

    coarse: int = 32
    """Frames from one mark to the next."""
    cold: Effort = (110, 10, 100)
    """Iterations of field step, phase fit and refinement of a mark."""
    near: float = 0.08
    """Error of the neighbours' mean up to which a refinement is enough."""
    smooth: int = 10
    """Iterations of that refinement."""
    smooth_last: int = 10
    """The same in the last level, on whose frames no others build."""
    smooth_wide: int = 24
    """The same where the neighbours are at least `wide` frames away, since all frames between build on them."""
    far: float = 0.3
    """Largest relative difference of a target from its neighbours' mean for a bent frame; above it is rough."""
    bent: Effort = (7, 9, 8)
    """Iterations of field step, phase fit and refinement of bent frames."""
    bent_wide: Effort = (15, 9, 60)
    """The same where the neighbours are at least `wide` frames away."""
    rough: Effort = (80, 9, 10)
    """Iterations of field step, phase fit and refinement of rough frames."""
    wide: int = 2
    """Distance in frames between neighbours, see `smooth_wide`."""
    block: int | None = None
    """Frames per block, solved by one job; other blocks only share a mark with it. If None, see `block_on`."""
    opening: int = 256
    """Frames of the first block, which is short so that its frames are there early."""
    jobs: int = field(default=1, compare=False)
    """Number of blocks solved at once; the phases are bit-identical for any number."""
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
                last, kept = (None, None) if after is None else after.known
                bisection = kept or BisectionStep.of(self, problem, array_backend)
                bisection = replace(bisection, operators=replace(bisection.operators, problem=problem))
                for frames, found in self._solved_blocks(bisection, audible, last):
                    last = found.last()
                    phase[frames], made[frames] = found.theta, found.iterations
                    if progress is not None:
                        progress(int(frames[-1]) + 1, len(phase))
            if progress is not None:
                # Frames after the last audible one need no work.
                progress(len(phase), len(phase))
            after = WarmStart(theta=phase[audible[-1]], known=(last, bisection))
        held = hold(phase, audible)
        return Answer(phase=held, iterations=made, status=status_of(len(phase), audible), end=after)

    def block_on(self) -> int:
        """Frames per block: 1024 on a CPU; on a GPU enough that the marks of one block fill a batch."""
        return self.block or (32 * 1024 if backend(self.backend).on_gpu else 1024)

    def _solved_blocks(
        self, bisection: BisectionStep, audible: Indices, before: SolvedFrames | None
    ) -> Iterator[tuple[Indices, SolvedFrames]]:
        """Yield frames and solutions of each block in order; `before` is the solution of the first frame, if known."""
        opening = self.opening if before is None else 0
        every = list(blocks(len(audible), coarse=self.coarse, size=self.block_on(), opening=opening))
        if before is not None:
            every[0] = replace(every[0], marks=every[0].marks[every[0].marks > 0])
        pool = ThreadPoolExecutor(self.jobs)
        try:
            marks = deque(
                pool.submit(_without_warnings, solve_marks, self, bisection, audible[block.marks]) for block in every
            )
            walks: deque[Future[SolvedFrames]] = deque()
            for block in every:
                frames, found = FrameBlock(self, bisection, audible[block.first : block.last + 1]), marks.popleft()
                frames.known.put(block.marks - block.first, found.result())
                index = block.marks - block.first
                if before is not None:
                    frames.known.put(np.zeros(1, np.int64), before)
                    index = np.concatenate([[0], index])
                before = found.result().last()
                walks.append(pool.submit(_without_warnings, frames.solve, index))
            for block in every:
                yield audible[block.first : block.last + 1], walks.popleft().result()
        finally:
            # An error or Ctrl-C waits for the blocks at work alone.
            pool.shutdown(cancel_futures=True)


def solve_marks(settings: Glide, bisection: BisectionStep, frames: Indices) -> SolvedFrames:
    """Solve frames of the problem from scratch."""
    found = bisection.empty(len(frames))
    for some in bisection.chunks(np.arange(len(frames))):
        found.put(some, bisection.from_scratch(bisection.batch(frames[some]), settings.cold))
    return found


class FrameBlock:
    """The frames from one mark to another; `known` holds their solutions, one row per frame."""

    def __init__(self, settings: Glide, bisection: BisectionStep, frames: Indices) -> None:
        self._settings, self._bisection, self._frames = settings, bisection, frames
        self.known = bisection.empty(len(frames))
        amplitude = bisection.operators.problem.amplitude[frames]
        size = np.maximum(np.linalg.norm(amplitude, axis=1, keepdims=True), settings.faintest)
        self._p = (amplitude / size).astype(self.known.theta.dtype)

    def solve(self, marks: Indices) -> SolvedFrames:
        """Solve all frames between the marks, which are in `known` already, level by level; return `known`."""
        for level in midpoints(marks):
            wide = bool((level[:, 2] - level[:, 0]).max() >= 2 * self._settings.wide)
            left = [self._solve_near(rows, wide=wide) for rows in self._bisection.chunks(level)]
            self._solve_rest(np.concatenate(left), wide=wide)
        return self.known

    def _solve_near(self, rows: Indices, *, wide: bool) -> Indices:
        """Solve those rows (before, middle, after) where the mean of the neighbours is close; return the other rows."""
        settings, array_backend = self._settings, self._bisection.operators.backend
        batch, around = self._bisection.batch(self._frames[rows[:, 1]]), self.neighbours(rows)
        state = self._bisection.begin(batch, around)
        near = np.sqrt(2 * array_backend.get(state.cost)) <= settings.near
        if near.any():
            if not near.all():
                xp, index = array_backend.xp, array_backend.put(np.flatnonzero(near))
                batch, around, state = taken(xp, batch, index), taken(xp, around, index), taken(xp, state, index)
            last = int((rows[:, 2] - rows[:, 0]).max()) == 2
            iterations = settings.smooth_wide if wide else settings.smooth_last if last else settings.smooth
            self.known.put(rows[near, 1], self._bisection.refine_mean(batch, around, state, iterations))
        return rows[~near]

    def _solve_rest(self, rows: Indices, *, wide: bool) -> None:
        """Solve frames whose target differs from the mean of their neighbours."""
        settings, (mean, part) = self._settings, self._mean_target(rows)
        rough = np.linalg.norm(self._p[rows[:, 1]] - part * mean, axis=1) > settings.far
        bent = settings.bent_wide if wide else settings.bent
        for kind, effort in ((False, bent), (True, settings.rough)):
            for some in self._bisection.chunks(rows[rough == kind]):
                batch = self._bisection.batch(self._frames[some[:, 1]])
                found = self._bisection.from_field(batch, self.neighbours(some), effort, rough=kind)
                self.known.put(some[:, 1], found)

    def neighbours(self, rows: Indices) -> Neighbours:
        """Means of the solved frames around the middle ones of rows (before, middle, after)."""
        array_backend, known = self._bisection.operators.backend, self.known
        put, first, last = array_backend.put, rows[:, 0], rows[:, 2]
        before, after = (put(share) for share in self._time_weights(rows))
        mean, part = self._mean_target(rows)
        phasor = array_backend.phasor
        return Neighbours(
            q=array_backend.unit(before * phasor(put(known.theta[first])) + after * phasor(put(known.theta[last]))),
            z=before * put(known.z[first]) + after * put(known.z[last]),
            p=put(mean),
            part=put(part),
            missed=put(self._p[rows[:, 1]] - part * mean),
            scale=put(np.sqrt(known.scale[first] * known.scale[last])),
            field_scale=put(np.sqrt(known.field_scale[first] * known.field_scale[last])),
        )

    def _mean_target(self, rows: Indices) -> tuple[Array, Array]:
        """The mean of the neighbours' targets, and its least-squares factor in the frame's own target."""
        before, after = self._time_weights(rows)
        mean = before * self._p[rows[:, 0]] + after * self._p[rows[:, 2]]
        # The mean of two non-negative targets of norm 1 has a squared norm of at least 1/2; the limit only guards.
        square = np.maximum((mean * mean).sum(axis=1, keepdims=True), 1e-20)
        return mean, (self._p[rows[:, 1]] * mean).sum(axis=1, keepdims=True) / square

    def _time_weights(self, rows: Indices) -> tuple[Array, Array]:
        """Weights of the frames before and after, by their distance in time, shape (row, 1) each."""
        after = ((rows[:, 1] - rows[:, 0]) / (rows[:, 2] - rows[:, 0])).astype(self._p.dtype)[:, None]
        return 1 - after, after


def _without_warnings(work: Callable[..., SolvedFrames], *arguments: Any) -> SolvedFrames:
    """Call `work` without NumPy's overflow warnings, which are set per thread; a step that overflows is rejected."""
    with np.errstate(over="ignore", invalid="ignore"):
        return work(*arguments)
