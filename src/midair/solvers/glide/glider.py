"""The moves of the recording solver: a frame from nothing, and one from the two around it. What they are for: `glide`.

Everything here works on arrays of the backend; a row is a frame.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Numbers, Rows
from midair.solvers.lbfgs import LBFGS, RowsState
from midair.solvers.moves import Batch, FieldMove, Machine

Effort = tuple[int, int, int]
"""Iterations of field, lift and polish."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moved:
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
class Glider:
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
    split, stiffness, hardest : int, float, float
        Iterations of ADMM, its weight in parts of the strongest mode, and the mean power of the drive that a field
        asks for, above which it has no chance and `hard_polish` iterations take its place.
    """

    machine: Machine
    field: FieldMove
    step: float
    momentum: float
    relaxation: float
    towards: float
    split: int
    stiffness: float
    hardest: float
    hard_polish: int

    def cold(self, batch: Batch, effort: Effort) -> Moved:
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

    def smooth(self, batch: Batch, around: Neighbours, state: RowsState, iterations: int) -> Moved:
        """Known that the mean of their neighbours nearly is: a polish from where `begin` stands."""
        method, function = self._method(), self.machine.phase_function(batch)
        for _ in range(iterations):
            method.step(function, state)
        q = self.machine.backend.phasor(state.x)
        z = batch.gain * (q @ self.machine.drive_back) * self.machine.root
        return self._solved(batch, state, z, around.field_scale)

    def bent(self, batch: Batch, around: Neighbours, effort: Effort, *, rough: bool) -> Moved:
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
        return LBFGS(memory=self.machine.memory, xp=self.machine.backend.xp)

    def _angle(self, q: Rows) -> Rows:
        xp = self.machine.backend.xp
        return xp.atan2(xp.imag(q), xp.real(q))

    def _polish(self, batch: Batch, theta: Rows, scale: Numbers, iterations: int) -> RowsState:
        return self._method().run(self.machine.phase_function(batch), theta, scale, iterations)

    def _solved(self, batch: Batch, state: RowsState, z: Rows, field_scale: Numbers) -> Moved:
        scale = state.scale * batch.gain[:, 0] ** 2
        return Moved(theta=state.x, z=z, scale=scale, field_scale=field_scale)

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
        xp = self.machine.backend.xp
        power = xp.real(xp.vecdot(a, a)) / q.shape[1]
        hard = np.asarray(self.machine.backend.get(power)) > self.hardest
        parts: list[tuple[NDArray[np.int64], RowsState]] = []
        for rows, longer in ((np.flatnonzero(~hard), False), (np.flatnonzero(hard), True)):
            if len(rows):
                index = self.machine.backend.put(rows)
                some, mine = batch.some(xp, index), xp.take(q, index, axis=0)
                if not longer:
                    mine = self._split(some, xp.take(a, index, axis=0), mine)
                its = self.hard_polish if longer else iterations
                parts.append((rows, self._polish(some, self._angle(mine), xp.take(scale, index), its)))
        return self._joined(parts)

    def _joined(self, parts: list[tuple[NDArray[np.int64], RowsState]]) -> RowsState:
        """The parts as one state, in the order of their rows."""
        if len(parts) == 1:
            return parts[0][1]
        xp = self.machine.backend.xp
        order = self.machine.backend.put(np.argsort(np.concatenate([rows for rows, _ in parts])))

        def joined(name: str) -> Rows:
            return xp.take(xp.concat([getattr(state, name) for _, state in parts], axis=0), order, axis=0)

        names = ("x", "gradient", "cost", "scale", "length")
        made: dict[str, Any] = {name: joined(name) for name in names}
        return RowsState(**made, pairs=[])

    def _split(self, batch: Batch, a: Rows, q: Rows) -> Rows:
        """ADMM: a, the field that is wanted, against b = V^H q, the one that phases can make; u is their dual.

        Boyd et al., "Distributed optimization and statistical learning via the alternating direction method of
        multipliers", 2011, section 3.1.1, with relaxation as in 3.4.3 and the steps towards a and q each taken once.
        """
        machine, there = self.machine, self.machine.backend
        s, points = machine.root**2, batch.p.shape[1]
        weight = (self.stiffness * machine.strongest * batch.gain) ** 2
        inverse = 1 / ((s * batch.gain) ** 2 + weight)
        b, u = q @ machine.drive_back, 0 * a
        for _ in range(self.split):
            y = ((batch.gain * a) @ machine.field)[:, :points]
            wanted = (batch.gain * (batch.p * there.unit(y))) @ machine.field_back[:points, :]
            a = (wanted + weight * (b - u)) * inverse
            u = u + 0.8 * (a - b)
            q = there.unit(q + self.relaxation * ((a + u - b) @ machine.drive))
            b = q @ machine.drive_back
        return q
