"""The moves of the recording solver: a frame from nothing, and one from the two around it. What they are for: `glide`.

Everything here works on arrays of the backend; a row is a frame.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Numbers, Rows
from midair.solvers.field_operators import Batch, FieldMove, FieldOperators, in_order
from midair.solvers.lbfgs import LBFGS, RowsState

Effort = tuple[int, int, int]
"""Iterations of field, lift and polish."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameSolution:
    """Some frames, on the backend.

    Attributes
    ----------
    theta : array, shape (row, transducer)
        Phases, in rad.
    z : array of complex, shape (row, mode)
        The field, see `moves.FieldMove`, that the phases make or were to make.
    scale, field_scale : array, shape (row,)
        Inverse curvature that polish and field ended with, in units of the target.
    """

    theta: Rows
    z: Rows
    scale: Numbers
    field_scale: Numbers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Neighbours:
    """What is known of frames that lie between two solved ones.

    Attributes
    ----------
    q : array of complex, shape (row, transducer)
        The mean of the two drives, of magnitude 1.
    z : array of complex, shape (row, mode)
        The mean of the two fields.
    p : array, shape (row, point)
        The mean of the two targets.
    part : array, shape (row, 1)
        How much of that mean the frame's own target is, least squares.
    missed : array, shape (row, point)
        What the target has besides.
    scale, field_scale : array, shape (row,)
        Geometric means of the two.
    """

    q: Rows
    z: Rows
    p: Rows
    part: Rows
    missed: Rows
    scale: Numbers
    field_scale: Numbers

    def some(self, xp: Any, rows: Numbers) -> "Neighbours":
        """The rows of these numbers."""
        parts: dict[str, Any] = {one.name: xp.take(getattr(self, one.name), rows, axis=0) for one in fields(self)}
        return Neighbours(**parts)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BisectionStep:
    """The moves on the machine of one problem.

    Attributes
    ----------
    machine : Machine
        The matrices.
    field : FieldMove
        The first move.
    step, momentum : float
        Of the heavy ball that lifts a field from a drive that nearly makes it.
    relaxation : float
        Over-relaxation of the projections, 1 to 2.
    towards : float
        How much of an even field, in parts of the peak, decides the phases of what is new in a target.
    split, stiffness, hardest, hard_polish : int, float, float, int
        Iterations and stiffness of ADMM, see `FieldOperators.split`. Above `hardest`, see `FieldOperators.possible`,
        `hard_polish` iterations of the polish take its place.
    """

    machine: FieldOperators
    field: FieldMove
    step: float
    momentum: float
    relaxation: float
    towards: float
    split: int
    stiffness: float
    hardest: float
    hard_polish: int

    def cold(self, batch: Batch, effort: Effort) -> FrameSolution:
        """Known of which nothing is known."""
        machine, xp = self.machine, self.machine.backend.xp
        one = xp.ones_like(batch.gain[:, 0]) / machine.strongest
        state = self.field.run(batch, self.field.first(batch.p * machine.psi), one, effort[0])
        theta = machine.lift(self.field.coordinates(batch, state), effort[1], relaxation=self.relaxation)
        polished = self._polish(batch, theta, one / machine.strongest, effort[2])
        return self._solved(batch, polished, self.machine.backend.as_complex(state.x), state.scale)

    def begin(self, batch: Batch, around: Neighbours) -> RowsState:
        """The mean of the neighbours' drives as the start of a polish, with its cost."""
        return self._method().begin(
            self.machine.phase_function(batch), self._angle(around.q), around.scale / batch.gain[:, 0] ** 2
        )

    def smooth(self, batch: Batch, around: Neighbours, state: RowsState, iterations: int) -> FrameSolution:
        """Known that the mean of their neighbours nearly is: a polish from where `begin` stands."""
        method, function = self._method(), self.machine.phase_function(batch)
        for _ in range(iterations):
            method.step(function, state)
        q = self.machine.backend.phasor(state.x)
        z = batch.gain * (q @ self.machine.drive_back) * self.machine.root
        return self._solved(batch, state, z, around.field_scale)

    def bent(self, batch: Batch, around: Neighbours, effort: Effort, *, rough: bool) -> FrameSolution:
        """Known whose target is another: all three moves from the mean field, bent to what is new in the target.

        With `rough` ADMM comes between lift and polish.
        """
        machine, there = self.machine, self.machine.backend
        y = (around.z @ self.field.out)[:, : batch.p.shape[1]]
        # The phases that the field has there already; where it is nearly silent, those of the lens.
        even = self.towards * there.xp.max(around.p, axis=1, keepdims=True)
        u = there.unit(there.unit(y) * around.p + even * machine.psi)
        z = around.part * around.z + self.field.first(around.missed * u)
        state = self.field.run(batch, z, around.field_scale, effort[0])
        a = self.field.coordinates(batch, state)
        q = self._follow(a, around.q, effort[1])
        scale = around.scale / batch.gain[:, 0] ** 2
        polished = (
            self._after_split(batch, a, q, scale, effort[2])
            if rough and batch.cells is None
            else self._polish(batch, self._angle(q), scale, effort[2])
        )
        return self._solved(batch, polished, there.as_complex(state.x), state.scale)

    def _method(self) -> LBFGS:
        return self.machine.descent

    def _angle(self, q: Rows) -> Rows:
        xp = self.machine.backend.xp
        return xp.atan2(xp.imag(q), xp.real(q))

    def _polish(self, batch: Batch, theta: Rows, scale: Numbers, iterations: int) -> RowsState:
        return self._method().run(self.machine.phase_function(batch), theta, scale, iterations)

    def _solved(self, batch: Batch, state: RowsState, z: Rows, field_scale: Numbers) -> FrameSolution:
        scale = state.scale * batch.gain[:, 0] ** 2
        return FrameSolution(theta=state.x, z=z, scale=scale, field_scale=field_scale)

    def _follow(self, a: Rows, q: Rows, iterations: int) -> Rows:
        """Drive of magnitude 1 with V^H q close to a, from q on, by a heavy ball on the phases; see `live`."""
        machine, there = self.machine, self.machine.backend
        xp = there.xp
        speed = xp.zeros_like(xp.real(q))
        for _ in range(iterations):
            change = (a - q @ machine.drive_back) @ machine.drive
            uphill = xp.real(q) * xp.imag(change) - xp.imag(q) * xp.real(change)
            speed = self.momentum * speed + self.step * uphill
            # A turn by the angle whose tangent is the speed: no sines.
            q = there.unit(there.complex(xp.real(q) - speed * xp.imag(q), xp.imag(q) + speed * xp.real(q)))
        return q

    def _after_split(self, batch: Batch, a: Rows, q: Rows, scale: Numbers, iterations: int) -> RowsState:
        """A polish of all rows, after ADMM where the drive can make the field; a longer one where it cannot."""
        machine = self.machine
        xp, put = machine.backend.xp, machine.backend.put
        possible = machine.possible(a, self.hardest)
        parts: list[tuple[NDArray[np.int64], RowsState]] = []
        for rows, easy in ((np.flatnonzero(possible), True), (np.flatnonzero(~possible), False)):
            if len(rows):
                index = put(rows)
                some, mine = batch.some(xp, index), xp.take(q, index, axis=0)
                if easy:
                    mine = machine.split(
                        some,
                        xp.take(a, index, axis=0),
                        mine,
                        self.split,
                        stiffness=self.stiffness,
                        relaxation=self.relaxation,
                    )
                its = iterations if easy else self.hard_polish
                parts.append((rows, self._polish(some, self._angle(mine), xp.take(scale, index), its)))
        return self._joined(parts)

    def _joined(self, parts: list[tuple[NDArray[np.int64], RowsState]]) -> RowsState:
        """The parts as one state, in the order of their rows."""
        made: dict[str, Any] = {
            name: in_order(self.machine.backend, [(rows, getattr(state, name)) for rows, state in parts])
            for name in ("x", "gradient", "cost", "scale", "length")
        }
        return RowsState(**made, pairs=[])
