"""Blocks of a recording: the order in which their frames are solved, and their solution.

Marks are solved first, then midpoints until no frame is left. Marks are counted from the first sounding frame, and a
block is a fixed number of marks, so that batches do not depend on the length of the recording or on the number of jobs.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Rows
from midair.solvers.bisection_step import BisectionStep, Effort, FrameSolution, Neighbours
from midair.solvers.field_operators import Batch
from midair.solvers.lbfgs import RowsState

if TYPE_CHECKING:
    pass

Indices = NDArray[np.int64]


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedFrames:
    """Solutions of frames as NumPy arrays, one row per frame, with the fields of `FrameSolution`."""

    theta: NDArray[np.floating[Any]]
    z: NDArray[np.complexfloating[Any, Any]]
    scale: NDArray[np.floating[Any]]
    field_scale: NDArray[np.floating[Any]]
    iterations: NDArray[np.int64]

    @classmethod
    def empty(cls, frames: int, bisection: BisectionStep) -> "SolvedFrames":
        """Allocate this number of rows."""
        modes, transducers = bisection.operators.drive.shape
        real, kind = (np.float32, np.complex64) if bisection.operators.backend.single else (np.float64, np.complex128)
        return cls(
            theta=np.zeros((frames, transducers), real),
            z=np.zeros((frames, modes), kind),
            scale=np.zeros(frames, real),
            field_scale=np.zeros(frames, real),
            iterations=np.zeros(frames, np.int64),
        )

    def keep(self, index: Indices, solved: FrameSolution, iterations: int, backend: Backend) -> None:
        """Copy a solution from the backend into these rows."""
        for name in ("theta", "z", "scale", "field_scale"):
            getattr(self, name)[index] = backend.host(getattr(solved, name))
        self.iterations[index] = iterations + solved.more

    def put(self, index: Indices, other: "SolvedFrames") -> None:
        """Copy all rows of another object into these rows."""
        for field in fields(self):
            getattr(self, field.name)[index] = getattr(other, field.name)

    def last(self) -> "SolvedFrames":
        """A copy of the last row."""
        return SolvedFrames(**{field.name: getattr(self, field.name)[-1:].copy() for field in fields(self)})


def solve_marks(bisection: BisectionStep, frames: Indices) -> SolvedFrames:
    """Solve frames of the problem from scratch."""
    efforts, operators = bisection.settings, bisection.operators
    found = SolvedFrames.empty(len(frames), bisection)
    for some in bisection.chunks(np.arange(len(frames))):
        solved = bisection.from_scratch(operators.batch(frames[some], faintest=efforts.faintest), efforts.cold)
        found.keep(some, solved, sum(efforts.cold), operators.backend)
    return found


class FrameBlock:
    """The frames from one mark to another; `known` holds their solutions, one row per frame."""

    def __init__(self, bisection: BisectionStep, frames: Indices) -> None:
        self._bisection, self._efforts, self._frames = bisection, bisection.settings, frames
        self.known = SolvedFrames.empty(len(frames), bisection)
        amplitude = bisection.operators.problem.amplitude[frames]
        size = np.maximum(np.linalg.norm(amplitude, axis=1, keepdims=True), self._efforts.faintest)
        self._p = (amplitude / size).astype(self.known.theta.dtype)

    def solve(self, marks: Indices) -> None:
        """Solve all frames between the marks, which are in `known` already, level by level."""
        for level in midpoints(marks):
            wide = bool((level[:, 2] - level[:, 0]).max() >= 2 * self._efforts.wide)
            left = [self._solve_near(rows, wide=wide) for rows in self._bisection.chunks(level)]
            self._solve_rest(np.concatenate(left), wide=wide)

    def _solve_near(self, rows: Indices, *, wide: bool) -> Indices:
        """Solve those rows (before, middle, after) where the mean of the neighbours is close; return the other rows."""
        efforts, backend = self._efforts, self._bisection.operators.backend
        batch, around = self._batch(rows[:, 1]), self._neighbours(rows)
        state = self._bisection.begin(batch, around)
        near = np.sqrt(2 * backend.get(state.cost)) <= efforts.near
        if near.any():
            if not near.all():
                index = backend.put(np.flatnonzero(near))
                batch, around = batch.some(backend.xp, index), around.some(backend.xp, index)
                state = _some(backend.xp, state, index)
            iterations = efforts.smooth_wide if wide else efforts.smooth
            self._keep(rows[near, 1], self._bisection.refine_mean(batch, around, state, iterations), iterations)
        return rows[~near]

    def _solve_rest(self, rows: Indices, *, wide: bool) -> None:
        """Solve frames whose target differs from the mean of their neighbours."""
        efforts = self._efforts
        mean, part = self._mean_target(rows)
        rough = np.linalg.norm(self._p[rows[:, 1]] - part * mean, axis=1) > efforts.far
        for some in self._bisection.chunks(rows[~rough]):
            self._solve_from_field(some, efforts.bent_wide if wide else efforts.bent, rough=False)
        for some in self._bisection.chunks(rows[rough]):
            self._solve_from_field(some, efforts.rough, rough=True)

    def _solve_from_field(self, rows: Indices, effort: Effort, *, rough: bool) -> None:
        solved = self._bisection.from_field(self._batch(rows[:, 1]), self._neighbours(rows), effort, rough=rough)
        self._keep(rows[:, 1], solved, sum(effort) + (self._efforts.split if rough else 0))

    def _batch(self, index: Indices) -> Batch:
        return self._bisection.operators.batch(self._frames[index], faintest=self._efforts.faintest)

    def _mean_target(self, rows: Indices) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """The mean of the neighbours' targets, and its least-squares factor in the frame's own target."""
        before, after = self._time_weights(rows)
        mean = before * self._p[rows[:, 0]] + after * self._p[rows[:, 2]]
        # The mean of two non-negative targets of norm 1 has a squared norm of at least 1/2; the limit only guards.
        square = np.maximum((mean * mean).sum(axis=1, keepdims=True), 1e-20)
        return mean, (self._p[rows[:, 1]] * mean).sum(axis=1, keepdims=True) / square

    def _neighbours(self, rows: Indices) -> Neighbours:
        backend, known = self._bisection.operators.backend, self.known
        put, first, last = backend.put, rows[:, 0], rows[:, 2]
        before, after = (put(share) for share in self._time_weights(rows))
        mean, part = self._mean_target(rows)
        mixed = before * backend.phasor(put(known.theta[first])) + after * backend.phasor(put(known.theta[last]))
        return Neighbours(
            q=backend.unit(mixed),
            z=before * put(known.z[first]) + after * put(known.z[last]),
            p=put(mean),
            part=put(part),
            missed=put(self._p[rows[:, 1]] - part * mean),
            scale=put(np.sqrt(known.scale[first] * known.scale[last])),
            field_scale=put(np.sqrt(known.field_scale[first] * known.field_scale[last])),
        )

    def _time_weights(self, rows: Indices) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """Weights of the frames before and after, by their distance in time, shape (row, 1) each."""
        after = ((rows[:, 1] - rows[:, 0]) / (rows[:, 2] - rows[:, 0])).astype(self._p.dtype)[:, None]
        return 1 - after, after

    def _keep(self, index: Indices, solved: FrameSolution, iterations: int) -> None:
        self.known.keep(index, solved, iterations, self._bisection.operators.backend)


def _some(xp: Any, state: RowsState, index: Rows) -> RowsState:
    """The rows with these indices of a descent that has just begun."""
    names = ("x", "gradient", "cost", "scale", "length")
    return RowsState(**{name: xp.take(getattr(state, name), index, axis=0) for name in names}, pairs=[])
