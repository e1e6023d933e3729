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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import MissingExtraError
from midair.model import Acoustics, ControlGrid, Progress, Status, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers.modes import Modes, modes
from midair.solvers.phases import rippled
from midair.solvers.problem import Answer, Problem, WarmStart

Complex = NDArray[np.complex128]

SIDES = np.array([[1, 1], [-1, 1], [1, -1], [-1, -1]])
"""Signs of x and y of each image."""

KINDS = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
"""Sign of each kind on each image, shape (kind, image); orthonormal, and its own inverse."""

_EMPTY, _MORE = 1.1, 1.3
"""Largest numbers of places per transducer, and of modes relative to the whole array, at which symmetry saves work."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SymmetricModes:
    """G = U diag(s) W^H with W of four kinds, or of one for an array without symmetry.

    Two by two AUTD3 units are a lattice with 12 empty places, symmetric under mirrors along x and y. Its modes are even
    or odd under each mirror. A drive split into four kinds, each on a quarter of the places, needs a quarter of the
    work for a product with V. The control points need not be centred on the lattice (on AUTD3 they are off by .7 mm);
    then only the drives are even or odd, and there are a few more modes.
    """

    U: Complex  # Fields, shape (point, kind * mode); kinds with fewer modes are padded with zeros
    s: Array  # Singular values in the unit of G, shape (kind * mode,)
    V: Complex  # Drives of each kind on the places of one image, shape (kind, mode, place)
    place: NDArray[np.intp]  # Index of each transducer among all places, image after image

    def drive(self, z: Complex) -> Complex:
        """W z, shape (transducer,), of coordinates z (kind * mode,)."""
        kinds = np.einsum("kmn,km->kn", self.V, z.reshape(self.V.shape[:2]))
        return (kinds if len(kinds) == 1 else KINDS.T @ kinds).reshape(-1)[self.place]


def full_phase(modes: Modes) -> SymmetricModes:
    """The modes of any array as one kind on one image."""
    return SymmetricModes(U=modes.U, s=modes.s, V=modes.V.T[None], place=np.arange(len(modes.V)))


def symmetric_modes(
    grid: ControlGrid, array: TransducerArray, *, acoustics: Acoustics, tolerance: float
) -> SymmetricModes | None:
    """The modes of an array by kind, in units of the strongest focus; None without symmetry, or if it saves nothing.

    Modes below `tolerance` times the strongest are left out.
    """
    lattice = _lattice(array)
    if lattice is None:
        return None
    whole, place = lattice
    G = transfer_matrix(grid, whole, acoustics=acoustics) / focus_amplitude(grid, array, acoustics=acoustics)
    of_kinds = np.einsum("ki,pin->kpn", KINDS, G.reshape(grid.count, len(KINDS), -1))
    found = [np.linalg.svd(fields, full_matrices=False) for fields in of_kinds]
    strongest = max(float(s[0]) for _, s, _ in found)
    each = [int((s > tolerance * strongest).sum()) for _, s, _ in found]
    # Points far from the centre couple to all kinds.
    if sum(each) > _MORE * max(np.linalg.matrix_rank(G, tolerance * np.linalg.norm(G, 2)), 1):
        return None
    most = max(each)
    U = np.zeros((grid.count, len(KINDS), most), np.complex128)
    s, V = np.zeros((len(KINDS), most)), np.zeros((len(KINDS), most, of_kinds.shape[2]), np.complex128)
    for kind, ((fields, strength, drives), count) in enumerate(zip(found, each, strict=True)):
        U[:, kind, :count], s[kind, :count] = fields[:, :count], strength[:count]
        V[kind, :count] = drives[:count].conj()
    return SymmetricModes(U=U.reshape(grid.count, -1), s=s.reshape(-1), V=V, place=place)


def _lattice(array: TransducerArray) -> tuple[TransducerArray, NDArray[np.intp]] | None:
    """The array with its empty places filled, image after image, and the index of each transducer in it.

    None if the array has no mirror symmetry, or its transducers differ.
    """
    if not array.alike or np.ptp(array.normal, axis=0).any() or np.abs(array.normal[0, :2]).any():
        return None
    middle = (array.position.min(axis=0) + array.position.max(axis=0)) / 2
    offset = array.position - middle
    # Rounded to a micrometre, far above rounding errors and far below the distance of transducers.
    steps = np.rint(np.abs(offset) * 1e6).astype(np.int64)
    _, first, at = np.unique(steps, axis=0, return_index=True, return_inverse=True)
    quarter = np.abs(offset[first])
    if (steps[:, :2] == 0).any() or 4 * len(quarter) > _EMPTY * array.count:
        return None
    side = (offset[:, 0] < 0) + 2 * (offset[:, 1] < 0)
    sides = np.concatenate([SIDES, np.ones((4, 1))], axis=1)
    position = middle + (sides[:, None] * quarter).reshape(-1, 3)
    whole = TransducerArray(
        position=position,
        normal=np.repeat(array.normal[:1], len(position), axis=0),
        pressure=array.pressure,
        frequency=array.frequency,
    )
    return whole, side * len(quarter) + at.reshape(-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """Settings of the live solver."""

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
