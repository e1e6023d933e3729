"""The frames of one block: what is solved of them so far, and the walk from the marks to the last frame."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Rows
from midair.solvers.field_operators import Batch
from midair.solvers.glide.bisection_step import BisectionStep, Effort, FrameSolution, Neighbours
from midair.solvers.glide.schedule import Indices, halvings
from midair.solvers.lbfgs import RowsState


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockIterations:
    """How much is done for frames of each kind, and what makes them so; see `glide.Glide`."""

    cold: Effort
    smooth: int
    smooth_wide: int
    bent: Effort
    bent_wide: Effort
    rough: Effort
    wide: int
    near: float
    far: float
    rows: int
    faintest: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedFrames:
    """What is known of solved frames, in NumPy's arrays, row by row; the fields are those of `glider.FrameSolution`."""

    theta: NDArray[np.floating[Any]]
    z: NDArray[np.complexfloating[Any, Any]]
    scale: NDArray[np.floating[Any]]
    field_scale: NDArray[np.floating[Any]]
    iterations: NDArray[np.int64]

    @classmethod
    def empty(cls, frames: int, glider: BisectionStep) -> "SolvedFrames":
        """Room for so many."""
        modes, transducers = glider.machine.drive.shape
        real, kind = (np.float32, np.complex64) if glider.machine.backend.single else (np.float64, np.complex128)
        return cls(
            theta=np.zeros((frames, transducers), real),
            z=np.zeros((frames, modes), kind),
            scale=np.zeros(frames, real),
            field_scale=np.zeros(frames, real),
            iterations=np.zeros(frames, np.int64),
        )

    def keep(self, index: Indices, solved: FrameSolution, iterations: int, there: Backend) -> None:
        """Write what was found on the backend into these rows."""
        for name in FrameSolution.__slots__:
            getattr(self, name)[index] = there.host(getattr(solved, name))
        self.iterations[index] = iterations

    def put(self, index: Indices, other: "SolvedFrames") -> None:
        """Write all rows of another into these."""
        for field in fields(self):
            getattr(self, field.name)[index] = getattr(other, field.name)

    def last(self) -> "SolvedFrames":
        """A copy of the last row."""
        return SolvedFrames(**{field.name: getattr(self, field.name)[-1:].copy() for field in fields(self)})


def marks_of(glider: BisectionStep, efforts: BlockIterations, frames: Indices) -> SolvedFrames:
    """Solve frames of the problem, of which nothing is known."""
    there, found = glider.machine.backend, SolvedFrames.empty(len(frames), glider)
    for some in _chunks(np.arange(len(frames)), efforts.rows):
        solved = glider.cold(glider.machine.batch(frames[some], faintest=efforts.faintest), efforts.cold)
        found.keep(some, solved, sum(efforts.cold), there)
    return found


class FrameBlock:
    """Frames from one mark to another, with room for what is found.

    Parameters
    ----------
    glider : Glider
        The moves.
    efforts : Efforts
        Iterations of frames of each kind.
    frames : ndarray of int, shape (frame,)
        Which frames of the problem they are.

    Attributes
    ----------
    known : Known
        One row a frame.
    """

    def __init__(self, glider: BisectionStep, efforts: BlockIterations, frames: Indices) -> None:
        self._glider, self._efforts, self._frames = glider, efforts, frames
        self.known = SolvedFrames.empty(len(frames), glider)
        amplitude = glider.machine.problem.amplitude[frames]
        size = np.maximum(np.linalg.norm(amplitude, axis=1, keepdims=True), efforts.faintest)
        self._p = (amplitude / size).astype(self.known.theta.dtype)

    def walk(self, marks: Indices) -> None:
        """Solve all frames between the marks, which `known` has already, level by level."""
        for level in halvings(marks):
            wide = bool((level[:, 2] - level[:, 0]).max() >= 2 * self._efforts.wide)
            left = [self._easy(rows, wide=wide) for rows in _chunks(level, self._efforts.rows)]
            self._others(np.concatenate(left), wide=wide)

    def _easy(self, rows: Indices, *, wide: bool) -> Indices:
        """Solve what the mean of its neighbours nearly is, of these rows (before, middle, after); give the others."""
        efforts, there = self._efforts, self._glider.machine.backend
        batch, around = self._batch(rows[:, 1]), self._around(rows)
        state = self._glider.begin(batch, around)
        near = np.sqrt(2 * there.get(state.cost)) <= efforts.near
        if near.any():
            if not near.all():
                index = there.put(np.flatnonzero(near))
                batch, around = batch.some(there.xp, index), around.some(there.xp, index)
                state = _some(there.xp, state, index)
            iterations = efforts.smooth_wide if wide else efforts.smooth
            self._keep(rows[near, 1], self._glider.smooth(batch, around, state, iterations), iterations)
        return rows[~near]

    def _others(self, rows: Indices, *, wide: bool) -> None:
        """Solve frames that ask for more than their neighbours tell."""
        efforts = self._efforts
        mean, part = self._mean_target(rows)
        rough = np.linalg.norm(self._p[rows[:, 1]] - part * mean, axis=1) > efforts.far
        for some in _chunks(rows[~rough], efforts.rows):
            self._bend(some, efforts.bent_wide if wide else efforts.bent, rough=False)
        for some in _chunks(rows[rough], efforts.rows):
            self._bend(some, efforts.rough, rough=True)

    def _bend(self, rows: Indices, effort: Effort, *, rough: bool) -> None:
        solved = self._glider.bent(self._batch(rows[:, 1]), self._around(rows), effort, rough=rough)
        self._keep(rows[:, 1], solved, sum(effort) + (self._glider.split if rough else 0))

    def _batch(self, index: Indices) -> Batch:
        return self._glider.machine.batch(self._frames[index], faintest=self._efforts.faintest)

    def _mean_target(self, rows: Indices) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """The mean of the neighbours' targets, and how much of it the frame's own is."""
        before, after = self._shares(rows)
        mean = before * self._p[rows[:, 0]] + after * self._p[rows[:, 2]]
        # Neighbours of norm 1 that do not overlap have a mean of at least 1/2: only rounding could make it vanish.
        square = np.maximum((mean * mean).sum(axis=1, keepdims=True), 1e-20)
        return mean, (self._p[rows[:, 1]] * mean).sum(axis=1, keepdims=True) / square

    def _around(self, rows: Indices) -> Neighbours:
        there, known = self._glider.machine.backend, self.known
        put, first, last = there.put, rows[:, 0], rows[:, 2]
        before, after = (put(share) for share in self._shares(rows))
        mean, part = self._mean_target(rows)
        mixed = before * there.phasor(put(known.theta[first])) + after * there.phasor(put(known.theta[last]))
        return Neighbours(
            q=there.unit(mixed),
            z=before * put(known.z[first]) + after * put(known.z[last]),
            p=put(mean),
            part=put(part),
            missed=put(self._p[rows[:, 1]] - part * mean),
            scale=put(np.sqrt(known.scale[first] * known.scale[last])),
            field_scale=put(np.sqrt(known.field_scale[first] * known.field_scale[last])),
        )

    def _shares(self, rows: Indices) -> tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]:
        """Weights of the frames before and after, by their distance, shape (row, 1) each."""
        after = ((rows[:, 1] - rows[:, 0]) / (rows[:, 2] - rows[:, 0])).astype(self._p.dtype)[:, None]
        return 1 - after, after

    def _keep(self, index: Indices, solved: FrameSolution, iterations: int) -> None:
        self.known.keep(index, solved, iterations, self._glider.machine.backend)


def _chunks(rows: Indices, size: int) -> Iterator[Indices]:
    for first in range(0, len(rows), size):
        yield rows[first : first + size]


def _some(xp: Any, state: RowsState, index: Rows) -> RowsState:
    """The rows of these numbers of a descent that has just begun."""
    names = ("x", "gradient", "cost", "scale", "length")
    return RowsState(**{name: xp.take(getattr(state, name), index, axis=0) for name in names}, pairs=[])
