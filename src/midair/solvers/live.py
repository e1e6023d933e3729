"""Solve one frame after another within a millisecond, for touch that is played while it is recorded.

The first two steps of `fast`, starting from the previous frame: the field in mode coordinates, then the phases that
make it. The field is stored in units of its target, so it follows a change of the overall level without iterations; the
new part of a target is added first, with the phases of the current field; L-BFGS keeps its pairs for the next frame.
The phase fit is a heavy-ball method (Polyak, "Some methods of speeding up the convergence of iteration methods", 1964).
For nearly random phases the eigenvalues of its matrix lie between l = (1 - sqrt(2 r / N))^2 / 2 = .11 and 1 for r = 136
modes and N = 996 transducers (Marchenko & Pastur, 1967), for which step 4 / (1 + sqrt l)^2 = 2.2 and momentum ((1 -
sqrt l) / (1 + sqrt l))^2 = .25 are best.

The number of iterations is fixed, so that every frame takes the same time. Needs Numba. A loop with a deadline should
use one BLAS thread (`one_blas_thread`) and disable Python's garbage collector between frames (`gc.disable()`).
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from midair.array_types import Array
from midair.errors import MissingExtraError
from midair.model import Progress, Status
from midair.solvers.mirror_symmetry import SymmetricModes, full_phase
from midair.solvers.modes import modes
from midair.solvers.phases import rippled
from midair.solvers.problem import Answer, Problem, WarmStart


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """Settings of the live solver."""

    terms: ClassVar[frozenset[str]] = frozenset({"amplitudes", "robust"})
    """Names of the terms that it supports besides the error of the paper."""

    iterations: int = 200
    """Iterations of the field for the first frame."""
    # With 7 + 9 iterations 99 % of the frames take less than a millisecond; fewer cannot follow sudden changes.
    warm_iterations: int = 7
    """Iterations of the field for each later frame."""
    lift_iterations: int = 60
    """Iterations of the phase fit for the first frame."""
    warm_lift_iterations: int = 9
    """Iterations of the phase fit for each later frame."""
    # Half the time; the next frames correct most of the additional error.
    hurried_iterations: int = 3
    """Iterations of the field for a frame with little time left."""
    hurried_lift_iterations: int = 4
    """Iterations of the phase fit for a frame with little time left."""
    # With 2e-3 a towel's error is 1 % smaller and a moving spot's 30 % larger, for a tenth more time.
    tolerance: float = 5e-3
    """Modes of G below this fraction of the largest singular value are left out."""
    loudness: float = 0.1
    """As in `Fast`; weighted more here, since no refinement follows."""
    floor: float = 0.1
    """As in `Fast`."""
    every: int = 4
    """As in `Fast`."""
    # Close to the optimum for random phases, 2.2 and .25 (see the module's docstring).
    step: float = 2.0
    """Step size of the heavy-ball phase fit."""
    momentum: float = 0.3
    """Momentum of the heavy-ball phase fit."""
    towards: float = 0.2
    """Weight, relative to the last target's peak, of an even field in the phases of the new part of a target."""
    memory: int = 6
    """As in `Fast`."""
    faintest: float = 1e-12
    """As in `Fast`."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases frame by frame."""
        frames = len(problem.amplitude)
        tracker = self.begin(problem) if after is None else after.known
        phase, made, status = np.zeros((frames, problem.transducers)), np.zeros(frames, np.int64), []
        for frame, p in enumerate(problem.amplitude):
            before = tracker.iterations
            phase[frame] = tracker.follow(p)
            made[frame] = tracker.iterations - before
            status.append("iterations" if made[frame] else "silent")
            if progress is not None:
                progress(frame + 1, frames)
        ended: tuple[Status, ...] = tuple(status)
        return Answer(phase=phase, iterations=made, status=ended, end=WarmStart(theta=phase[-1], known=tracker))

    def begin(self, problem: Problem, *, folded: SymmetricModes | None = None) -> "FrameTracker":
        """A tracker for the G of the problem, compiled so that its first frame is not late.

        `folded` are the modes from `symmetric_modes` for an array with mirror symmetry, which halve the time.
        """
        return FrameTracker(problem, self, folded=folded)


class FrameTracker:
    """Keeps the last frame's field and drive, and computes phases for the next target.

    `problem` gives G, level and initial phases of the field; its targets are ignored. `folded` is as in `Live.begin`.
    """

    def __init__(self, problem: Problem, settings: Live, *, folded: SymmetricModes | None = None) -> None:
        try:
            from midair.solvers import live_kernel
        except ImportError as missing:
            raise MissingExtraError('the live solver needs numba: pip install "midair[live]"') from missing
        self.iterations = 0
        self._kernel: Any = live_kernel
        self._settings = settings
        kept = folded or full_phase(modes(problem.G, tolerance=settings.tolerance))
        images, each, places = kept.V.shape
        s = problem.level * kept.s
        root = np.sqrt(s)
        # Modes of strength 0, which only pad their kind, get no inverse.
        whole, inverse, least = kept.U * root, _inverse(root), _inverse(s)
        self._root = np.where(s > 0, root, 1).astype(np.float32)
        self._out = np.ascontiguousarray(whole.T, np.complex64)
        self._V, self._place = np.ascontiguousarray(kept.V, np.complex64), kept.place
        some = kept.V[:, :, :: settings.every] * inverse.reshape(images, each, 1)
        self._drive = np.ascontiguousarray(some, np.complex64)
        self._weight = np.float32(settings.loudness / (images * some.shape[2]))
        # p of norm 1 -> initial coordinates of the field p exp(j psi), as in the batch solver.
        smooth = root * s / (s**2 + (settings.floor * s.max()) ** 2)
        self._psi = np.exp(1j * problem.first_psi).astype(np.complex64)
        self._first = smooth[:, None] * kept.U.conj().T * np.exp(1j * problem.first_psi)
        self._weak = (smooth * inverse).astype(np.float32)
        lens = kept.drive(least * (kept.U.conj().T @ np.exp(1j * problem.first_psi)))
        self._q = np.zeros((images, places), np.complex64)
        self._q.reshape(-1)[kept.place] = rippled(lens)
        rank = len(s)
        self._z = np.zeros(rank, np.complex64)
        self._p, self._before = np.zeros(problem.points, np.float32), np.zeros(problem.points, np.float32)
        self._pairs, self._work = live_kernel.workspace(
            problem.points, (images, some.shape[2]), rank, settings.memory, 1 / float(s.max())
        )
        self._error, self._change = np.zeros(rank, np.complex64), np.zeros_like(self._q)
        self._kinds, self._speed = np.zeros_like(self._q), np.zeros(self._q.shape, np.float32)
        self._warm = False
        self._move(np.float32(1), 0, 0, bends=True)  # no iterations: compiles all kernels without changing the state

    def follow(self, p: Array, *, hurried: bool = False) -> Array:
        """Phases (transducer,) in rad for the target p (point,); those of the frame before if p is zero.

        `hurried` halves the time and increases the error.
        """
        if p.any():
            settings = self._settings
            size = max(float(np.linalg.norm(p)), settings.faintest)
            np.divide(p, size, out=self._p, casting="same_kind")
            if self._warm:
                count, lift = settings.warm_iterations, settings.warm_lift_iterations
                if hurried:
                    count, lift = settings.hurried_iterations, settings.hurried_lift_iterations
            else:
                count, lift = settings.iterations, settings.lift_iterations
                self._z[:] = self._first @ self._p
                self._before[:] = self._p
            self._move(np.float32(size), count, lift, bends=self._warm)
            self._warm = True
            self.iterations += count
        return np.angle(self._q.reshape(-1)[self._place]).astype(np.float64)

    def _move(self, size: np.float32, field: int, lift: int, *, bends: bool) -> None:
        settings = self._settings
        towards = np.float32(settings.towards)
        y, g = self._work[0], self._work[4]
        step, momentum = np.float32(settings.step), np.float32(settings.momentum)
        self._kernel.follow(
            bends,
            (self._z, self._p, self._before, self._out, self._psi, towards, self._weak, y, g),
            (self._z, self._p, size, self._out, self._drive, self._weight, self._pairs, self._work),
            (self._q, self._root, self._V, step, momentum, self._error, self._change, self._kinds, self._speed),
            field,
            lift,
        )


def _inverse(x: Array) -> Array:
    """1 / x; 0 where x is 0."""
    return np.where(x > 0, 1 / np.where(x > 0, x, 1), 0)
