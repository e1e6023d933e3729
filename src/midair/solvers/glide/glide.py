"""A recording as a whole, by bisection in time: few frames cold, all others from the two that lie around them.

Marks far apart are solved from nothing, as the batch solver does. Then come the frames halfway between solved ones,
level by level, so that each starts at the mean of two drives that are right before and after it, and a polish of some
iterations does. No frame waits for the one before it, so that all of a level are one batch and there are no seams; and
since drives change little from frame to frame, the array keeps still, which matters more than a smaller error.

Known whose target is not what lies between its neighbours' first get a field and phases of their own. How this was
chosen, and what lost: docs/decisions/0024-glide.md.
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Progress
from midair.solvers.backend import Backend, backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.glide.bisection_step import BisectionStep, Effort
from midair.solvers.glide.frame_block import BlockIterations, FrameBlock, SolvedFrames, marks_of
from midair.solvers.glide.schedule import BlockRange, Indices, blocks
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, Problem, WarmStart, status_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Glide:
    """Settings of the recording solver; the defaults suit 1 kHz, those of the best mode 4 kHz.

    Attributes
    ----------
    coarse : int
        Known from one mark to the next.
    cold : tuple of int
        Iterations of field, lift and polish of a mark.
    near : float
        Error of the neighbours' mean up to which a polish is enough.
    smooth, smooth_wide : int
        Iterations of that polish; the second where the neighbours are `wide` frames away or more, since all frames
        below build on those.
    far : float
        What a target may have besides its neighbours' mean, in parts of its norm, to count as bent; else as rough.
    bent, bent_wide, rough : tuple of int
        Iterations of field, lift and polish of bent frames and of rough ones.
    wide : int
        As above.
    split, stiffness, hardest, hard_polish : int, float, float, int
        ADMM between lift and polish of rough frames, see `glider.BisectionStep`.
    towards : float
        How much of an even field decides the phases of what is new in a target.
    tolerance : float
        Modes of G below this part of the largest singular value are left out of the iterations; the error that is
        reported is that of the whole G.
    outside : float
        How much a point of the guard counts, over a control point, when the modes are chosen.
    loudness : float
        Weight of drives above full in the field.
    every : int
        One transducer in so many, evenly over the array, is looked at for loudness.
    floor : float
        Modes below this part of the largest singular value are asked for less in the first field.
    step, momentum : float
        Of the heavy ball that lifts, as in `Live`.
    relaxation : float
        Over-relaxation of the projections, 1 to 2.
    memory : int
        Pairs that L-BFGS keeps.
    rows : int, optional
        Known of a batch. What suits the backend if None.
    block : int, optional
        Known that are solved one after the other by one job; others know them by a mark only. What suits the backend
        if None: `block_on`.
    jobs : int
        Blocks at once. The phases are the same, to the last bit, for any number.
    faintest : float
        Norm of a target, in units of the focus, below which it counts as this faint: the range of single precision.
    precision : {"single", "double"}
        Precision of the iterations.
    backend : str
        What does the arithmetic, and where: see `backend.backend`.
    """

    coarse: int = 32
    cold: Effort = (110, 10, 100)
    near: float = 0.1
    smooth: int = 10
    smooth_wide: int = 40
    far: float = 0.3
    bent: Effort = (7, 9, 8)
    bent_wide: Effort = (15, 9, 60)
    rough: Effort = (80, 9, 10)
    wide: int = 8
    split: int = 10
    stiffness: float = 0.05
    hardest: float = 0.55
    hard_polish: int = 40
    towards: float = 0.2
    # With 5e-3, as in the batch solver, what is left out would limit the error.
    tolerance: float = 2e-3
    outside: float = 0.3
    loudness: float = 0.1
    every: int = 4
    floor: float = 0.1
    step: float = 2.0
    momentum: float = 0.3
    relaxation: float = 1.5
    memory: int = 4
    rows: int | None = None
    block: int | None = None
    jobs: int = field(default=1, compare=False)
    faintest: float = 1e-12
    precision: Literal["single", "double"] = "single"
    backend: str = "numpy"

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Phases for each frame; silent ones keep those of the frame before them.

        After a part of a recording, the problem's first frame is the last of that part, a mark that is solved already.

        Raises
        ------
        InputError
            If the backend is unknown, or there is less than one job.
        MissingExtraError
            If the backend is not installed.
        """
        if self.jobs < 1:
            raise InputError(f"jobs: expected 1 or more, got {self.jobs}")
        there = backend(self.backend, precision=self.precision)
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        phase = np.zeros((len(problem.amplitude), problem.transducers))
        made = np.zeros(len(phase), np.int64)
        if after is not None:
            phase[audible[:1]] = after.theta
        if len(audible) > (after is not None):
            with there.at_work():
                glider = self._glider(problem, there)
                last = None if after is None else after.known
                for frames, found in self._stretches(glider, audible, last):
                    last = found.last()
                    phase[frames], made[frames] = found.theta, found.iterations
                    if progress is not None:
                        progress(int(frames[-1]) + 1, len(phase))
            if progress is not None:
                # Frames after the last audible one need no work: they are done.
                progress(len(phase), len(phase))
            after = WarmStart(theta=phase[audible[-1]], known=last)
        held = hold(phase, audible)
        return Answer(phase=held, iterations=made, status=status_of(len(phase), audible), end=after)

    def _stretches(
        self, glider: BisectionStep, audible: Indices, before: SolvedFrames | None
    ) -> Iterator[tuple[Indices, SolvedFrames]]:
        """The blocks in order: which frames they are, and what was found; `before` is known of the first frame."""
        efforts = self._efforts()
        every = list(blocks(len(audible), coarse=self.coarse, size=self.block_on()))
        if before is not None:
            every[0] = replace(every[0], marks=every[0].marks[every[0].marks > 0])
        with ThreadPoolExecutor(self.jobs) as pool:
            marks = deque(pool.submit(_quietly, marks_of, glider, efforts, audible[block.marks]) for block in every)
            walks: deque[Future[SolvedFrames]] = deque()
            for block in every:
                found = marks.popleft().result()
                frames = audible[block.first : block.last + 1]
                walks.append(pool.submit(_quietly, _walked, glider, efforts, frames, block, before, found))
                before = found.last()
            for block in every:
                yield audible[block.first : block.last + 1], walks.popleft().result()

    def end_of(self, marks: Problem) -> WarmStart:
        """Where the frames before a block end, known without solving them: from the marks of the block before it.

        Parameters
        ----------
        marks : Problem
            Its frames are those marks alone, all of them: the same batch gives the same bits.
        """
        there = backend(self.backend, precision=self.precision)
        with there.at_work():
            glider = self._glider(marks, there)
            last = _quietly(marks_of, glider, self._efforts(), np.arange(len(marks.amplitude))).last()
        return WarmStart(theta=last.theta[0], known=last)

    def block_on(self) -> int:
        """Frames of a block: 1024 on a CPU; on a GPU so many that the marks of one block are a batch worth a launch."""
        return self.block or (32 * 1024 if backend(self.backend).on_gpu else 1024)

    def _efforts(self) -> BlockIterations:
        own: dict[str, Any] = {one.name: getattr(self, one.name) for one in fields(BlockIterations)}
        own["rows"] = self.rows or backend(self.backend).rows
        return BlockIterations(**own)

    def _glider(self, problem: Problem, there: Backend) -> BisectionStep:
        machine = FieldOperators.of(problem, there, tolerance=self.tolerance, memory=self.memory, outside=self.outside)
        seats = spread_out(problem.position, every=self.every, count=problem.transducers)
        return BisectionStep(
            machine=machine,
            field=machine.field_move(loudness=self.loudness, floor=self.floor, seats=seats),
            step=self.step,
            momentum=self.momentum,
            relaxation=self.relaxation,
            towards=self.towards,
            split=self.split,
            stiffness=self.stiffness,
            hardest=self.hardest,
            hard_polish=self.hard_polish,
        )


def spread_out(position: NDArray[np.float64] | None, *, every: int, count: int) -> Indices:
    """One transducer in so many, evenly over the array: each next is the farthest from those before it.

    Where nobody knows the positions, every so many-th.
    """
    if position is None:
        return np.arange(0, count, every)
    chosen = [int(position[:, :2].sum(axis=1).argmin())]
    distance = np.full(count, np.inf)
    while len(chosen) < max(count // every, 1):
        distance = np.minimum(distance, ((position - position[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distance.argmax()))
    return np.sort(np.array(chosen))


def _walked(
    glider: BisectionStep,
    efforts: BlockIterations,
    frames: Indices,
    block: BlockRange,
    before: SolvedFrames | None,
    marks: SolvedFrames,
) -> SolvedFrames:
    """All frames of a block, from its marks and the last mark of the block before it."""
    stretch, index = FrameBlock(glider, efforts, frames), block.marks - block.first
    stretch.known.put(index, marks)
    if before is not None:
        stretch.known.put(np.zeros(1, np.int64), before)
        index = np.concatenate([[0], index])
    stretch.walk(index)
    return stretch.known


def _quietly(work: Callable[..., SolvedFrames], *arguments: Any) -> SolvedFrames:
    """Without NumPy's warnings of what overflows, which counts as a step that failed; each thread has its own."""
    with np.errstate(over="ignore", invalid="ignore"):
        return work(*arguments)
