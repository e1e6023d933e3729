"""Solve frames with an amplitude for each transducer, with the least power and the least sound at quiet places.

Drives of equal amplitude send out the same power in every frame; what the target does not need goes elsewhere, also to
the ears. Here the error is minimised together with the effort q^H M q, where M is a share of the power plus the mean
square of the sound at the places of the quiet terms. The unknowns are coordinates of the field in the modes of G
M^(-1/2), for the drive q = M^(-1/2) V a, so that quiet places cost no computation in the iterations.

All frames start at the same phases of the field, which the paper leaves free: those of the even field with the least
effort. A frame's own best phases would need less effort, but follow the target, and transducers blur what moves.
docs/decisions/0044-felt-and-quiet.md compares the alternatives.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress
from midair.solvers.backend import Backend, Rows, backend, taken
from midair.solvers.field_operators import Batch, FieldMove, FieldOperators, evenly_spread
from midair.solvers.lbfgs import RowsState
from midair.solvers.modes import Keyed
from midair.solvers.phases import hold
from midair.solvers.problem import Answer, GuardField, Problem, WarmStart, status_of

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """Settings of the solver with free amplitudes."""

    terms: ClassVar[frozenset[str]] = frozenset({"cells", "guard", "robust", "quiet-ears", "quiet-palm"})
    """Names of the terms that it supports besides the error of the paper."""

    iterations: int = 60
    """Iterations of a frame that is solved from scratch."""
    between: int = 12
    """Iterations of a frame that starts at the mean of two solved frames around it."""
    every: int = 16
    """Distance in frames between frames that are solved from scratch."""
    near: float = 0.3
    """Error of that mean up to which `between` iterations are enough."""
    effort: float = 1e-3
    """Weight of the effort relative to the error, for a target in the strongest mode."""
    even: tuple[float, int] = (0.3, 200)
    """The same weight, and the iterations, for the even field with whose phases all frames start."""
    power: float = 0.03
    """Weight of a transducer's power in the effort: the squared relative error (.17 rad) that quiet places bear."""
    loudness: float = 10.0
    """Weight of the penalty on amplitudes above full drive, for frames that have any."""
    bounded: int = 30
    """Further iterations of these frames."""
    tolerance: float = 3e-2
    """Modes below this fraction of the largest singular value are left out, except from the reported error."""
    outside: float = 0.3
    """Weight of a guard point in the choice of modes."""
    floor: float = 0.1
    """Modes below this fraction of the largest singular value are damped in the initial field."""
    memory: int = 4
    """Number of pairs that L-BFGS keeps."""
    block: int = 256
    """Frames that are solved together, without those before and after them."""
    faintest: float = 1e-12
    """As in `Fast`."""
    precision: Literal["single", "double"] = "single"
    """Precision of the iterations."""
    backend: str = "numpy"
    """Array library and device, see `backend.backend`."""

    def solve(self, problem: Problem, *, after: WarmStart | None = None, progress: Progress | None = None) -> Answer:
        """Compute phases and amplitudes for each frame; silent frames keep the phases of the frame before."""
        audible = np.flatnonzero(problem.amplitude.any(axis=1))
        q = np.zeros((len(problem.amplitude), problem.transducers), np.complex64)
        made = np.zeros(len(q), np.int64)
        array_backend = backend(self.backend, precision=self.precision)
        if len(audible):
            with array_backend.at_work():
                moves = _moves(self, problem, array_backend)
                for first in range(0, len(audible), self.block):
                    frames = audible[first : first + self.block]
                    q[frames], made[frames] = _Block(self, moves, frames).solve()
                    if progress is not None:
                        progress(int(frames[-1]) + 1, len(q))
            if progress is not None:
                progress(len(q), len(q))
        phase = hold(np.angle(q).astype(np.float64), audible, None if after is None else after.theta)
        return Answer(
            phase=phase,
            # Rounding can give slightly more than full drive, which `Drive` rejects.
            level=np.minimum(np.abs(q), 1.0).astype(np.float64),
            iterations=made,
            status=status_of(len(q), audible),
            end=WarmStart(theta=phase[audible[-1]]) if len(audible) else after,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Moves:
    """The field step without and with the penalty on amplitudes above full drive."""

    free: FieldMove
    bounded: FieldMove

    @property
    def operators(self) -> FieldOperators:
        return self.free.operators

    def drive(self, batch: Batch, state: RowsState) -> NDArray[np.complex64]:
        """Drives of a state, (row, transducer), relative to the level of the problem."""
        return self.operators.backend.host(self.operators.drive.of_modes(self.free.coordinates(batch, state)))


def _moves(settings: Free, problem: Problem, array_backend: Backend) -> _Moves:
    """The operators in the coordinates in which the effort is the squared length of the drive."""
    root, guard = np.eye(problem.transducers, dtype=np.complex128), problem.guard
    if guard is not None and (quiet := guard.ceilings == 0).any():
        root = _inverse_root(Keyed.of(guard.G[quiet]), settings.power)
        guard = GuardField(G=guard.G[~quiet], ceiling=guard.ceilings[~quiet], weight=guard.weight)
    if guard is not None:
        guard = replace(guard, G=guard.G @ root) if len(guard.G) else None
    changed = replace(problem, G=problem.G @ root, guard=guard, position=None)
    operators = FieldOperators.of(
        changed, array_backend, tolerance=settings.tolerance, memory=settings.memory, outside=settings.outside
    )
    operators = replace(operators, psi=_phases_of_even_field(settings, operators))
    turned = operators.drive.matrix @ array_backend.put(root.T)
    own = replace(operators, drive=replace(operators.drive, matrix=turned, back=array_backend.adjoint(turned)))
    sampled = evenly_spread(problem.position, every=4, count=problem.transducers)
    free, bounded = (
        own.field_move(loudness=weight, floor=settings.floor, sampled=sampled, effort=settings.effort)
        for weight in (0.0, settings.loudness)
    )
    return _Moves(free=free, bounded=bounded)


def _phases_of_even_field(settings: Free, operators: FieldOperators) -> Rows:
    """The numbers exp j psi of the even field with the least effort, shape (point,)."""
    effort, iterations = settings.even
    cells = operators.problem.cells
    # Windows end before the outermost points: a field with soft edges needs less effort.
    share = np.ones(operators.problem.points) if cells is None else cells.weights.sum(axis=0)
    even = replace(operators.problem, amplitude=np.sqrt(share)[None], cells=None)
    alone = replace(operators, problem=even, weights=None)
    move = alone.field_move(loudness=0.0, floor=settings.floor, sampled=np.zeros(1, np.int64), effort=effort)
    batch, backend = alone.batch(np.zeros(1, np.int64), faintest=settings.faintest), alone.backend
    one = backend.xp.ones_like(batch.gain[:, 0]) / alone.strongest
    state = move.run(batch, move.first(batch.p * alone.psi), one, iterations)
    return backend.unit(move.out.of_modes(backend.as_complex(state.x))[0, : even.points])


# Each part of a recording has the same rows.
@lru_cache(maxsize=2)
def _inverse_root(keyed: Keyed, power: float) -> NDArray[np.complex128]:
    """M^(-1/2) for the effort M = R / mean(diag R) + power, with R the Gram matrix of the rows."""
    rows = keyed.rows
    gram = rows.conj().T @ rows
    size, vectors = np.linalg.eigh(gram / gram.diagonal().real.mean())
    root = (vectors / np.sqrt(np.maximum(size, 0) + power)) @ vectors.conj().T
    return np.asarray(root, np.complex128)


class _Block:
    """Solve successive frames: a few from scratch, then those between them."""

    def __init__(self, settings: Free, moves: _Moves, frames: Indices) -> None:
        self._settings, self._moves, self._frames = settings, moves, frames
        operators = moves.operators
        self._q = np.zeros((len(frames), operators.drive.shape[1]), np.complex64)
        self._z = np.zeros((len(frames), operators.drive.shape[0]), np.complex64)
        self._scale = np.zeros(len(frames))
        self._made = np.zeros(len(frames), np.int64)

    def solve(self) -> tuple[NDArray[np.complex64], Indices]:
        """Drives (frame, transducer) and iterations (frame,)."""
        last = len(self._frames) - 1
        marks = np.unique(np.minimum(np.arange(0, last + self._settings.every, self._settings.every), last))
        batches = self._moves.operators.backend.batches
        for rows in batches(marks):
            self._from_scratch(rows)
        rest = np.setdiff1d(np.arange(last), marks)
        for rows in batches(rest):
            after = np.searchsorted(marks, rows)
            self._from_neighbours(rows, marks[after - 1], marks[after])
        return self._q, self._made

    def _batch(self, rows: Indices) -> Batch:
        return self._moves.operators.batch(self._frames[rows], faintest=self._settings.faintest)

    def _from_scratch(self, rows: Indices) -> None:
        batch, operators = self._batch(rows), self._moves.operators
        one = operators.backend.xp.ones_like(batch.gain[:, 0]) / operators.strongest
        start = self._moves.free.first(batch.p * operators.psi)
        self._keep(rows, batch, self._moves.free.run(batch, start, one, self._settings.iterations))

    def _from_neighbours(self, rows: Indices, before: Indices, after: Indices) -> None:
        share = ((rows - before) / (after - before)).astype(np.float32)[:, None]
        z = (1 - share) * self._z[before] + share * self._z[after]
        backend, free = self._moves.operators.backend, self._moves.free
        start, scale = backend.put(z), backend.put(np.sqrt(self._scale[before] * self._scale[after]))
        batch = self._batch(rows)
        close = np.sqrt(2 * backend.get(free.run(batch, start, scale, 0).cost)) <= self._settings.near
        if not close.all():
            self._from_scratch(rows[~close])
        if close.any():
            index = backend.put(np.flatnonzero(close))
            some, begin, size = (taken(backend.xp, each, index) for each in (batch, start, scale))
            self._keep(rows[close], some, free.run(some, begin, size, self._settings.between))

    def _keep(self, rows: Indices, batch: Batch, state: RowsState, penalised: FieldMove | None = None) -> None:
        """Store the solution; frames with amplitudes above full drive are first continued with a penalty on them."""
        moves, backend = self._moves, self._moves.operators.backend
        q = moves.drive(batch, state)
        self._q[rows] = q / np.maximum(np.abs(q), 1)
        self._z[rows] = backend.host(backend.as_complex(state.x))
        self._scale[rows] = backend.get(state.scale)
        self._made[rows] += state.iterations
        loud = np.flatnonzero(np.abs(q).max(axis=1) > 1)
        if len(loud) and penalised is not moves.bounded:
            index = backend.put(loud)
            some, z, scale = (
                taken(backend.xp, each, index) for each in (batch, backend.as_complex(state.x), state.scale)
            )
            self._keep(rows[loud], some, moves.bounded.run(some, z, scale, self._settings.bounded), moves.bounded)
