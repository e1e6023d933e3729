"""Steps of the bisection solver on the backend: solve frames from scratch, or from their two solved neighbours.

A row is a frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Numbers, Rows
from midair.solvers.field_operators import Batch, FieldMove, FieldOperators, in_order
from midair.solvers.lbfgs import LBFGS, RowsState

if TYPE_CHECKING:
    from midair.solvers.glide import Glide

Effort = tuple[int, int, int]
"""Iterations of the field step, the phase fit and the refinement."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameSolution:
    """Solution of some frames, on the backend."""

    theta: Rows  # Phases in rad, shape (row, transducer)
    z: Rows  # Field in the coordinates of `FieldMove`, shape (row, mode), that the phases make or approximate
    scale: Numbers  # Final inverse curvature of the refinement, in units of the target, shape (row,)
    field_scale: Numbers  # Final inverse curvature of the field step, in units of the target, shape (row,)
    more: NDArray[np.int64] | int = 0  # Additional iterations of bad rows, shape (row,)


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

    def some(self, xp: Any, rows: Numbers) -> "Neighbours":
        """The rows with these indices."""
        parts: dict[str, Any] = {one.name: xp.take(getattr(self, one.name), rows, axis=0) for one in fields(self)}
        return Neighbours(**parts)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BisectionStep:
    """The steps with the matrices of one problem."""

    operators: FieldOperators
    field: FieldMove  # The field step
    settings: "Glide"

    def chunks(self, rows: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """The rows in batches."""
        return self.operators.backend.batches(rows, self.settings.rows)

    def from_scratch(self, batch: Batch, effort: Effort) -> FrameSolution:
        """Solve frames without solved neighbours."""
        operators, xp = self.operators, self.operators.backend.xp
        one = xp.ones_like(batch.gain[:, 0]) / operators.strongest
        state = self.field.run(batch, self.field.first(batch.p * operators.psi), one, effort[0])
        theta = operators.phase_fit(
            self.field.coordinates(batch, state), effort[1], relaxation=self.settings.relaxation
        )
        polished = self._refine(batch, theta, one / operators.strongest, effort[2])
        more = self._rescue(batch, polished)
        return self._solved(batch, polished, self.operators.backend.as_complex(state.x), state.scale, more)

    def begin(self, batch: Batch, around: Neighbours) -> RowsState:
        """Start of a refinement at the mean of the neighbours' drives, with its cost."""
        return self._method().begin(
            self.operators.phase_function(batch), self._angle(around.q), around.scale / batch.gain[:, 0] ** 2
        )

    def refine_mean(self, batch: Batch, around: Neighbours, state: RowsState, iterations: int) -> FrameSolution:
        """Continue the refinement from the state of `begin`."""
        method, function = self._method(), self.operators.phase_function(batch)
        for _ in range(iterations):
            method.step(function, state)
        more = self._rescue(batch, state)
        q = self.operators.backend.phasor(state.x)
        z = batch.gain * self.operators.drive.to_modes(q) * self.operators.root
        return self._solved(batch, state, z, around.field_scale, more)

    def from_field(self, batch: Batch, around: Neighbours, effort: Effort, *, rough: bool) -> FrameSolution:
        """Solve frames by all three steps, from the mean field adapted to the new part of the target.

        `rough` adds ADMM between phase fit and refinement.
        """
        operators, backend = self.operators, self.operators.backend
        y = (around.z @ self.field.out)[:, : batch.p.shape[1]]
        # The phases of the mean field; where it is nearly silent, the initial phases.
        even = self.settings.towards * backend.xp.max(around.p, axis=1, keepdims=True)
        u = backend.unit(backend.unit(y) * around.p + even * operators.psi)
        z = around.part * around.z + self.field.first(around.missed * u)
        state = self.field.run(batch, z, around.field_scale, effort[0])
        a = self.field.coordinates(batch, state)
        q = self._phase_fit(a, around.q, effort[1])
        scale = around.scale / batch.gain[:, 0] ** 2
        polished = (
            self._refine_with_admm(batch, a, q, scale, effort[2])
            if rough and batch.cells is None
            else self._refine(batch, self._angle(q), scale, effort[2])
        )
        more = self._rescue(batch, polished)
        return self._solved(batch, polished, backend.as_complex(state.x), state.scale, more)

    def _method(self) -> LBFGS:
        return self.operators.descent

    def _angle(self, q: Rows) -> Rows:
        xp = self.operators.backend.xp
        return xp.atan2(xp.imag(q), xp.real(q))

    def _refine(self, batch: Batch, theta: Rows, scale: Numbers, iterations: int) -> RowsState:
        return self._method().run(self.operators.phase_function(batch), theta, scale, iterations)

    def _rescue(self, batch: Batch, state: RowsState) -> NDArray[np.int64] | int:
        """Continue the refinement of the worst rows of a folded array; returns the iterations of each row."""
        rows, iterations = batch.p.shape[0], self.settings.rescue
        if self.operators.drive.images == 1:
            return 0
        worst = np.argsort(state.cost)[-((rows + 7) // 8) :]
        worst = worst[state.cost[worst] > self.settings.bad**2 / 2]
        more = np.zeros(rows, np.int64)
        if len(worst):
            better = self._refine(batch.some(np, worst), state.x[worst], state.scale[worst], iterations)
            state.x[worst], state.scale[worst], more[worst] = better.x, better.scale, iterations
        return more

    def _solved(
        self, batch: Batch, state: RowsState, z: Rows, field_scale: Numbers, more: NDArray[np.int64] | int = 0
    ) -> FrameSolution:
        scale = state.scale * batch.gain[:, 0] ** 2
        return FrameSolution(theta=state.x, z=z, scale=scale, field_scale=field_scale, more=more)

    def _phase_fit(self, a: Rows, q: Rows, iterations: int) -> Rows:
        """Drive of magnitude 1 with V^H q close to a, by a heavy ball on the phases starting at q; see `live`."""
        operators, backend = self.operators, self.operators.backend
        xp = backend.xp
        speed = xp.zeros_like(xp.real(q))
        for _ in range(iterations):
            change = operators.drive.of_modes(a - operators.drive.to_modes(q))
            uphill = xp.real(q) * xp.imag(change) - xp.imag(q) * xp.real(change)
            speed = self.settings.momentum * speed + self.settings.step * uphill
            # Rotate by the angle whose tangent is the speed, which needs no sine.
            q = backend.unit(backend.complex(xp.real(q) - speed * xp.imag(q), xp.imag(q) + speed * xp.real(q)))
        return q

    def _refine_with_admm(self, batch: Batch, a: Rows, q: Rows, scale: Numbers, iterations: int) -> RowsState:
        """Refine all rows: after ADMM where equal amplitudes can reach the field, with more iterations elsewhere."""
        operators = self.operators
        xp, put = operators.backend.xp, operators.backend.put
        reachable = operators.reachable(a, self.settings.hardest)
        parts: list[tuple[NDArray[np.int64], RowsState]] = []
        for rows, easy in ((np.flatnonzero(reachable), True), (np.flatnonzero(~reachable), False)):
            if len(rows):
                index = put(rows)
                some, drives = batch.some(xp, index), xp.take(q, index, axis=0)
                if easy:
                    drives = operators.admm(
                        some,
                        xp.take(a, index, axis=0),
                        drives,
                        self.settings.split,
                        stiffness=self.settings.stiffness,
                        relaxation=self.settings.relaxation,
                    )
                its = iterations if easy else self.settings.hard_polish
                parts.append((rows, self._refine(some, self._angle(drives), xp.take(scale, index), its)))
        return self._joined(parts)

    def _joined(self, parts: list[tuple[NDArray[np.int64], RowsState]]) -> RowsState:
        """The parts as one state, in the order of their rows."""
        made: dict[str, Any] = {
            name: in_order(self.operators.backend, [(rows, getattr(state, name)) for rows, state in parts])
            for name in ("x", "gradient", "cost", "scale", "length")
        }
        return RowsState(**made, pairs=[])
