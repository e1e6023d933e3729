"""Steps of the recording solver on the backend: solve frames from scratch, or from their two solved neighbours.

A row is a frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Numbers, Rows, taken
from midair.solvers.field_operators import Batch, FieldMove, FieldOperators, evenly_spread, in_order
from midair.solvers.lbfgs import RowsState
from midair.solvers.problem import Problem

Indices = NDArray[np.int64]
Effort = tuple[int, int, int]
"""Iterations of the field step, the phase fit and the refinement."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSettings:
    """Settings of the steps; the defaults suit 1 kHz, those of the best mode 4 kHz."""

    split: int = 10
    """Iterations of ADMM between phase fit and refinement of rough frames."""
    stiffness: float = 0.05
    """Penalty of ADMM, relative to the strongest mode."""
    hardest: float = 0.55
    """Fraction of the array's power, needed for a field, above which `hard_polish` replaces ADMM."""
    hard_polish: int = 40
    """Iterations of the refinement of such frames."""
    bad: float = 0.01
    """Error of a frame above which the worst frames of a batch, at most one in eight, are refined further: on an array
    that is folded by its mirrors, where single frames would otherwise end at a larger error.
    """
    rescue: int = 12
    """Iterations of that refinement."""
    first: float = 0.25
    """Factor on the first step from the neighbours' mean. The full step, which the curvature of their last step gives,
    is often refused: the error of a new target lies in stiffer directions than what their iterations left.
    """
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
    faintest: float = 1e-12
    """As in `Fast`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedFrames:
    """Solutions of frames as NumPy arrays, one row per frame."""

    theta: NDArray[np.floating[Any]]  # Phases in rad, shape (row, transducer)
    # Field in the coordinates of `FieldMove`, shape (row, mode), that the phases make or approximate
    z: NDArray[np.complexfloating[Any, Any]]
    scale: NDArray[np.floating[Any]]  # Final inverse curvature of the refinement, in units of the target, shape (row,)
    field_scale: NDArray[np.floating[Any]]  # The same of the field step
    iterations: NDArray[np.int64]  # Shape (row,)

    def put(self, index: Indices, other: "SolvedFrames") -> None:
        """Copy all rows of another object into these rows."""
        for field in fields(self):
            getattr(self, field.name)[index] = getattr(other, field.name)

    def last(self) -> "SolvedFrames":
        """A copy of the last row."""
        return SolvedFrames(**{field.name: getattr(self, field.name)[-1:].copy() for field in fields(self)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Neighbours:
    """Means of the two solved frames around each frame."""

    q: Rows  # Mean drive, normalised to magnitude 1, shape (row, transducer)
    z: Rows  # Mean field, shape (row, mode)
    p: Rows  # Mean target, shape (row, point)
    part: Rows  # Least-squares factor of the mean target in the frame's own target, shape (row, 1)
    missed: Rows  # Remainder of the frame's target, shape (row, point)
    scale: Numbers  # Geometric mean, shape (row,)
    field_scale: Numbers  # Geometric mean, shape (row,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BisectionStep:
    """The steps with the matrices of one problem."""

    operators: FieldOperators
    field: FieldMove  # The field step
    settings: StepSettings

    @classmethod
    def of(cls, settings: StepSettings, problem: Problem, backend: Backend) -> "BisectionStep":
        """Compute the matrices."""
        operators = FieldOperators.of(
            problem, backend, tolerance=settings.tolerance, memory=settings.memory, outside=settings.outside
        )
        columns = problem.transducers // operators.drive.images
        position = None if problem.position is None else problem.position[:columns]
        sampled = evenly_spread(position, every=settings.every, count=columns)
        field = operators.field_move(loudness=settings.loudness, floor=settings.floor, sampled=sampled)
        return cls(operators=operators, field=field, settings=settings)

    def chunks(self, rows: Indices) -> Iterator[Indices]:
        """The rows in batches."""
        return self.operators.backend.batches(rows, self.settings.rows)

    def batch(self, frames: Indices) -> Batch:
        """The targets of these frames of the problem."""
        return self.operators.batch(frames, faintest=self.settings.faintest)

    def empty(self, frames: int) -> SolvedFrames:
        """Allocate this number of solutions."""
        modes, transducers = self.operators.drive.shape
        real, kind = (np.float32, np.complex64) if self.operators.backend.single else (np.float64, np.complex128)
        return SolvedFrames(
            theta=np.zeros((frames, transducers), real),
            z=np.zeros((frames, modes), kind),
            scale=np.zeros(frames, real),
            field_scale=np.zeros(frames, real),
            iterations=np.zeros(frames, np.int64),
        )

    def from_scratch(self, batch: Batch, effort: Effort) -> SolvedFrames:
        """Solve frames without solved neighbours."""
        operators, xp = self.operators, self.operators.backend.xp
        one = xp.ones_like(batch.gain[:, 0]) / operators.strongest
        state = self.field.run(batch, self.field.first(batch.p * operators.psi), one, effort[0])
        a = self.field.coordinates(batch, state)
        theta = operators.phase_fit(a, effort[1], relaxation=self.settings.relaxation)
        refined = self._refine(batch, theta, one / operators.strongest, effort[2])
        return self._solved(batch, refined, operators.backend.as_complex(state.x), state.scale, sum(effort))

    def begin(self, batch: Batch, around: Neighbours) -> RowsState:
        """Start of a refinement at the mean of the neighbours' drives, with its cost."""
        operators, scale = self.operators, self.settings.first * around.scale / batch.gain[:, 0] ** 2
        return operators.descent.begin(operators.phase_function(batch), operators.backend.angle(around.q), scale)

    def refine_mean(self, batch: Batch, around: Neighbours, state: RowsState, iterations: int) -> SolvedFrames:
        """Continue the refinement from the state of `begin`."""
        method, function = self.operators.descent, self.operators.phase_function(batch)
        for _ in range(iterations):
            method.step(function, state)
        return self._solved(batch, state, None, around.field_scale, iterations)

    def from_field(self, batch: Batch, around: Neighbours, effort: Effort, *, rough: bool) -> SolvedFrames:
        """Solve frames by all three steps, from the mean field adapted to the new part of the target.

        `rough` adds ADMM between phase fit and refinement.
        """
        operators, backend = self.operators, self.operators.backend
        y = operators.points.of_modes(around.z / operators.root)
        # The phases of the mean field; where it is nearly silent, the initial phases.
        even = self.settings.towards * backend.xp.max(around.p, axis=1, keepdims=True)
        u = backend.unit(backend.unit(y) * around.p + even * operators.psi)
        z = around.part * around.z + self.field.first(around.missed * u)
        state = self.field.run(batch, z, self.settings.first * around.field_scale, effort[0])
        a = self.field.coordinates(batch, state)
        q = self._phase_fit(a, around.q, effort[1])
        scale = self.settings.first * around.scale / batch.gain[:, 0] ** 2
        if rough and batch.cells is None:
            refined = self.refine_with_admm(batch, a, q, scale, effort[2])
        else:
            refined = self._refine(batch, backend.angle(q), scale, effort[2])
        made = sum(effort) + (self.settings.split if rough else 0)
        return self._solved(batch, refined, backend.as_complex(state.x), state.scale, made)

    def refine_with_admm(self, batch: Batch, a: Rows, q: Rows, scale: Numbers, iterations: int) -> RowsState:
        """Refine all rows: after ADMM where equal amplitudes can reach the field, with more iterations elsewhere."""
        operators, backend, settings = self.operators, self.operators.backend, self.settings
        reachable = operators.reachable(a, settings.hardest)
        parts: list[tuple[Indices, RowsState]] = []
        for rows, easy in ((np.flatnonzero(reachable), True), (np.flatnonzero(~reachable), False)):
            if len(rows):
                index = backend.put(rows)
                some, field, drives = (taken(backend.xp, each, index) for each in (batch, a, q))
                if easy:
                    how = {"stiffness": settings.stiffness, "relaxation": settings.relaxation}
                    drives = operators.admm(some, field, drives, settings.split, **how)
                its = iterations if easy else settings.hard_polish
                parts.append((rows, self._refine(some, backend.angle(drives), taken(backend.xp, scale, index), its)))
        first = parts[0][1]
        joined = {
            name: in_order(backend, [(rows, getattr(state, name)) for rows, state in parts])
            for name in ("x", "gradient", "cost", "scale", "length")
        }
        return first if len(parts) == 1 else replace(first, **joined)

    def _refine(self, batch: Batch, theta: Rows, scale: Numbers, iterations: int) -> RowsState:
        return self.operators.descent.run(self.operators.phase_function(batch), theta, scale, iterations)

    def _solved(
        self, batch: Batch, state: RowsState, z: Rows | None, field_scale: Numbers, iterations: int
    ) -> SolvedFrames:
        """The solution of a refinement, after more iterations for the worst rows; z None: the field of the phases."""
        backend, more = self.operators.backend, self._rescue(batch, state)
        if z is None:
            z = batch.gain * self.operators.drive.to_modes(backend.phasor(state.x)) * self.operators.root
        scale = state.scale * batch.gain[:, 0] ** 2
        theta, z, scale, field_scale = (backend.host(each) for each in (state.x, z, scale, field_scale))
        return SolvedFrames(theta=theta, z=z, scale=scale, field_scale=field_scale, iterations=iterations + more)

    def _rescue(self, batch: Batch, state: RowsState) -> Indices:
        """Continue the refinement of the worst rows of a folded array; returns the iterations of each row."""
        rows, iterations = batch.p.shape[0], self.settings.rescue
        more = np.zeros(rows, np.int64)
        if self.operators.drive.images == 1:
            return more
        worst = np.argsort(state.cost)[-((rows + 7) // 8) :]
        worst = worst[state.cost[worst] > self.settings.bad**2 / 2]
        if len(worst):
            better = self._refine(taken(np, batch, worst), state.x[worst], state.scale[worst], iterations)
            state.x[worst], state.scale[worst], more[worst] = better.x, better.scale, iterations
        return more

    def _phase_fit(self, a: Rows, q: Rows, iterations: int) -> Rows:
        """Drive of magnitude 1 with V^H q close to a, by a heavy ball on the phases starting at q; see `live`."""
        drive, backend = self.operators.drive, self.operators.backend
        xp = backend.xp
        speed = xp.zeros_like(xp.real(q))
        for _ in range(iterations):
            change = drive.of_modes(a - drive.to_modes(q))
            uphill = xp.real(q) * xp.imag(change) - xp.imag(q) * xp.real(change)
            speed = self.settings.momentum * speed + self.settings.step * uphill
            # Rotate by the angle whose tangent is the speed, which needs no sine.
            q = backend.unit(backend.complex(xp.real(q) - speed * xp.imag(q), xp.imag(q) + speed * xp.real(q)))
        return q
