"""The three moves of the batch solver: field, lift, polish. What they are for: `fast`.

Everything here works on arrays of the backend; a row is a frame.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Numbers, Rows, squares
from midair.solvers.device import RingLBFGS
from midair.solvers.lbfgs import LBFGS, Function, RowsState
from midair.solvers.modes import modes
from midair.solvers.phases import rippled
from midair.solvers.problem import Problem
from midair.solvers.terms import cell_misfit, change, excess, misfit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """The targets of some frames, each scaled to norm 1 and the array made louder to match.

    Then the cost is E^2 / 2, and single precision is enough.

    Attributes
    ----------
    p : array, shape (row, point)
        Targets of norm 1.
    gain : array, shape (row, 1)
        One over the norm that they had.
    peak : array, shape (row, 1)
        Largest of p.
    cells, cell_scale : array, shape (row, cell) and (row,), or None
        Wanted readings, and one over their norm squared.
    """

    p: Rows
    gain: Rows
    peak: Rows
    cells: Rows = None
    cell_scale: Numbers = None

    def some(self, xp: Any, rows: Numbers) -> "Batch":
        """The rows of these numbers."""
        parts = (self.p, self.gain, self.peak, self.cells, self.cell_scale)
        p, gain, peak, cells, scale = (None if one is None else xp.take(one, rows, axis=0) for one in parts)
        return Batch(p=p, gain=gain, peak=peak, cells=cells, cell_scale=scale)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldOperators:
    """The matrices of one problem on a backend, and the moves.

    Listeners are the control points, and after them the points of the guard.

    Attributes
    ----------
    backend : Backend
        Where the arrays are.
    problem : Problem
        The problem that the matrices are of.
    field : array of complex, shape (mode, listener)
        U diag(s) A, transposed: from V^H q to the field.
    drive : array of complex, shape (mode, transducer)
        V transposed.
    field_back, drive_back : array of complex
        Their adjoints.
    root : array, shape (mode,)
        Square roots of the singular values times A.
    strongest : float
        Largest of the singular values times A.
    psi : array of complex, shape (point,)
        exp j psi, the first phase of the field.
    lens : array of complex, shape (1, transducer)
        The drive that all frames start from.
    weights : array, shape (point, cell), or None
        Weights of the cells.
    ceiling : array, shape (1, guard point), or None
        Of the guard.
    memory : int
        Pairs that L-BFGS keeps.
    """

    backend: Backend
    problem: Problem
    field: Rows
    drive: Rows
    field_back: Rows
    drive_back: Rows
    root: Numbers
    strongest: float
    psi: Numbers
    lens: Rows
    weights: Rows
    ceiling: Rows
    memory: int

    @classmethod
    def of(
        cls, problem: Problem, backend: Backend, *, tolerance: float, memory: int, outside: float = 1.0
    ) -> "FieldOperators":
        """Make it from the modes above `tolerance` of the strongest, which are worked out in double precision.

        The points of the guard count `outside` as much as control points when the modes are chosen: a field that is
        only to be quiet need not be known as well.
        """
        heard, weighed = problem.G, problem.G
        if problem.guard is not None:
            heard = np.concatenate([problem.G, problem.guard.G])
            weighed = np.concatenate([problem.G, outside * problem.guard.G])
        kept = modes(weighed, tolerance=tolerance)
        s, psi = problem.level * kept.s, np.exp(1j * problem.first_psi)
        lens = (psi @ kept.U[: problem.points].conj() / np.where(s > 0, s, 1)) @ kept.V.T
        field, drive = backend.put(problem.level * (heard @ kept.V).T), backend.put(kept.V.T)
        return cls(
            backend=backend,
            problem=problem,
            field=field,
            drive=drive,
            field_back=backend.adjoint(field),
            drive_back=backend.adjoint(drive),
            root=backend.put(np.sqrt(s)),
            strongest=float(s[0]),
            psi=backend.put(psi),
            lens=backend.put(rippled(lens)[None, :]),
            weights=None if problem.cells is None else backend.put(problem.cells.weights.T),
            ceiling=None if problem.guard is None else backend.put(problem.guard.ceilings[None, :]),
            memory=memory,
        )

    def batch(self, frames: NDArray[np.int64], *, faintest: float) -> Batch:
        """The targets of these frames; those whose norm is below `faintest` count as so faint."""
        amplitude, cells = self.problem.amplitude[frames], self.problem.cells
        size = np.maximum(np.linalg.norm(amplitude, axis=1, keepdims=True), faintest)
        p, put = amplitude / size, self.backend.put
        batch = {"p": put(p), "gain": put(1 / size), "peak": put(p.max(axis=1, keepdims=True))}
        if cells is not None:
            wanted = cells.wanted[frames] / size**2
            norm = np.maximum((wanted**2).sum(axis=1), faintest)
            batch |= {"cells": put(wanted), "cell_scale": put(1 / norm)}
        return Batch(**batch)

    def best_field(self, batch: Batch, iterations: int, *, loudness: float, floor: float, every: int) -> Rows:
        """Coordinates V^H q of the best field with free amplitudes, (row, mode)."""
        move = self.field_move(loudness=loudness, floor=floor, seats=np.arange(0, self.problem.transducers, every))
        one = self.backend.xp.ones_like(batch.gain[:, 0])
        state = move.run(batch, move.first(batch.p * self.psi), one / self.strongest, iterations)
        return move.coordinates(batch, state)

    def field_move(self, *, loudness: float, floor: float, seats: NDArray[np.int64]) -> "FieldMove":
        """The first move: `loudness` is the weight of drives above full, looked at where the `seats` are."""
        # In z = sqrt(s) a the weak modes are neither stiff nor out of reach; a and s a are both slower.
        heard_at = self.backend.xp.take(self.drive, self.backend.put(seats), axis=1)
        out, loud = self.field / self.root[:, None], heard_at / self.root[:, None]
        return FieldMove(
            machine=self,
            out=out,
            loud=loud,
            out_back=self.backend.adjoint(out),
            loud_back=self.backend.adjoint(loud),
            loudness=loudness / loud.shape[1],
            pseudo=self.root / (self.root**4 + (floor * self.strongest) ** 2),
        )

    @property
    def descent(self) -> LBFGS:
        """The method that suits the backend: NumPy's pairs in the order of a cache, or a ring."""
        method = LBFGS if self.backend.xp is np else RingLBFGS
        return method(memory=self.memory, xp=self.backend.xp)

    def lift(self, a: Rows, iterations: int, *, relaxation: float) -> Rows:
        """Phases of equally loud drives with V^H q close to a, (row, transducer), in rad.

        All rows start at the same drive, that of the lens, so that what no point can hear stays alike from frame to
        frame.
        """
        xp, q = self.backend.xp, self.lens
        for _ in range(iterations):
            q = self.backend.unit(q + relaxation * ((a - q @ self.drive_back) @ self.drive))
        q = xp.broadcast_to(q, (a.shape[0], q.shape[1]))
        return xp.atan2(xp.imag(q), xp.real(q))

    def possible(self, a: Rows, hardest: float) -> NDArray[np.bool_]:
        """Which rows of a field a, V^H q (row, mode), equally loud drives can come close to, shape (row,).

        Those whose least drive asks for no more than this part of the power that the array has.
        """
        xp = self.backend.xp
        power = xp.real(xp.vecdot(a, a)) / self.drive.shape[1]
        return np.asarray(self.backend.get(power) <= hardest)

    def split(self, batch: Batch, a: Rows, q: Rows, iterations: int, *, stiffness: float, relaxation: float) -> Rows:
        """ADMM: a, the field that is wanted, against b = V^H q, the one that phases can make; u is their dual.

        Boyd et al., "Distributed optimization and statistical learning via the alternating direction method of
        multipliers", 2011, section 3.1.1, with one step each towards a and q. It looks at the control points only.

        Parameters
        ----------
        batch : Batch
            The targets.
        a : array of complex, shape (row, mode)
            Field that is wanted first.
        q : array of complex, shape (row, transducer)
            Drive of magnitude 1 that is near to it.
        iterations : int
            Number of them.
        stiffness : float
            Weight of the difference of a and b, in parts of the strongest mode.
        relaxation : float
            Over-relaxation of the step towards q, 1 to 2.

        Returns
        -------
        array of complex, shape (row, transducer)
            Drive of magnitude 1.
        """
        there, s, points = self.backend, self.root**2, batch.p.shape[1]
        weight = (stiffness * self.strongest * batch.gain) ** 2
        inverse = 1 / ((s * batch.gain) ** 2 + weight)
        b, u = q @ self.drive_back, 0 * a
        for _ in range(iterations):
            y = ((batch.gain * a) @ self.field)[:, :points]
            wanted = (batch.gain * (batch.p * there.unit(y))) @ self.field_back[:points, :]
            a = (wanted + weight * (b - u)) * inverse
            # Less than the full step of the dual, which at few iterations overshoots.
            u = u + 0.8 * (a - b)
            q = there.unit(q + relaxation * ((a + u - b) @ self.drive))
            b = q @ self.drive_back
        return q

    def polish(self, theta: Rows, batch: Batch, iterations: int, *, more: int) -> Rows:
        """Least cost from theta on, (row, transducer), with `more` iterations for the worst quarter."""
        xp, method = self.backend.xp, self.descent
        step = 1 / (self.strongest * batch.gain[:, 0]) ** 2
        state = method.run(self.phase_function(batch), theta, step, iterations)
        if not more:
            return state.x
        order = xp.argsort(state.cost)
        # The quarter is rounded up, so that a frame alone in its batch counts as worst.
        good = theta.shape[0] - (theta.shape[0] + 3) // 4
        worst = order[good:]
        x, scale = xp.take(state.x, worst, axis=0), xp.take(state.scale, worst)
        better = method.run(self.phase_function(batch.some(xp, worst)), x, scale, more).x
        sorted_x = xp.concat([xp.take(state.x, order[:good], axis=0), better], axis=0)
        return xp.take(sorted_x, xp.argsort(order), axis=0)

    def together(self, theta: Rows, batch: Batch, before: Rows, iterations: int, *, slowest: float = 1e-2) -> Rows:
        """Least cost of all rows and of the changes between them, from theta on, (row, transducer).

        One descent for the whole batch, since each row now depends on its neighbours. A faint frame's error is
        steeper by the square of its gain: its unknown is the phase over a part of 1, at least `slowest`, so that one
        step length suits all.

        Parameters
        ----------
        theta : array, shape (row, transducer)
            Phases to start from, in rad.
        batch : Batch
            The targets.
        before : array of complex, shape (1, transducer)
            Drive of the frame before the first, which is not moved; zero if there is none.
        iterations : int
            Number of iterations of L-BFGS.
        slowest : float
            As above.
        """
        xp, shape, smooth = self.backend.xp, theta.shape, self.problem.smooth
        least = xp.min(batch.gain)
        part = xp.clip(least / batch.gain, slowest, None)
        alone = self.phase_function(batch)

        def function(x: Rows) -> tuple[Numbers, Rows]:
            here = part * xp.reshape(x, shape)
            cost, gradient = alone(here)
            extra, pull = change(xp, self.backend.phasor(here), before, smooth)
            total = xp.reshape(xp.sum(cost + extra), (1,))
            return total, xp.reshape(part * (gradient + pull), (1, -1))

        step = xp.reshape(1 / (self.strongest * least) ** 2, (1,))
        start = xp.reshape(theta / part, (1, -1))
        x = self.descent.run(function, start, step, iterations).x
        return part * xp.reshape(x, shape)

    def phase_function(self, batch: Batch) -> Function:
        """The function of theta that gives cost and gradient, row by row.

        With r the slope of the cost by the field, its gradient by theta_n is Im(conj(q_n) (G^H r)_n).
        """
        xp, gain = self.backend.xp, batch.gain

        def function(theta: Rows) -> tuple[Numbers, Rows]:
            q = self.backend.phasor(theta)
            cost, slope = self.heard(batch, (gain * (q @ self.drive_back)) @ self.field)
            back = (gain * (slope @ self.field_back)) @ self.drive
            if xp is not np:
                return cost, xp.real(q) * xp.imag(back) - xp.imag(q) * xp.real(back)
            back *= xp.conj(q)
            # NumPy's imaginary part is a view with gaps that would keep the whole product in memory.
            return cost, xp.asarray(xp.imag(back), copy=True)

        return function

    def heard(self, batch: Batch, y: Rows) -> tuple[Numbers, Rows]:
        """Cost of the field y (row, listener), which may be overwritten, and its slope by y."""
        xp, guard, points = self.backend.xp, self.problem.guard, batch.p.shape[1]
        square = y if guard is None else y[:, :points]
        if batch.cells is None:
            cost, slope = misfit(xp, square, batch.p)
        else:
            cost, slope = cell_misfit(xp, square, self.weights, batch.cells, batch.cell_scale)
        if guard is None:
            return cost, slope
        extra, outside = excess(xp, y[:, points:], self.ceiling * batch.peak, guard.weight)
        return cost + extra, xp.concat([slope, outside], axis=1)


def in_order(there: Backend, parts: list[tuple[NDArray[np.int64], Rows]]) -> Rows:
    """Rows that were worked on apart, as one array in the order of their numbers."""
    if len(parts) == 1:
        return parts[0][1]
    order = there.put(np.argsort(np.concatenate([rows for rows, _ in parts])))
    return there.xp.take(there.xp.concat([part for _, part in parts], axis=0), order, axis=0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMove:
    """The first move: the best field of all that free amplitudes can make, in the few coordinates of a field.

    A row of z is sqrt(s) V^H q, in units of the row's target, so that it follows a target that only grows by itself.

    Attributes
    ----------
    machine : Machine
        Whose field.
    out, out_back : array of complex
        From z to the listeners, shape (mode, listener), and its adjoint.
    loud, loud_back : array of complex
        From z to some transducers, shape (mode, seat), and its adjoint: a drive made of r modes is smooth, so that
        some tell how loud all are.
    loudness : float
        Weight of drives above full, for each of the seats.
    pseudo : array, shape (mode,)
        From what the points hear backwards to z, without asking much of weak modes.
    """

    machine: FieldOperators
    out: Rows
    out_back: Rows
    loud: Rows
    loud_back: Rows
    loudness: float
    pseudo: Numbers

    def first(self, y: Rows) -> Rows:
        """The z whose field at the control points comes close to y, (row, point): root s U^H y / (s^2 + floor^2)."""
        return (y @ self.machine.field_back[: y.shape[1], :]) * self.pseudo

    def run(self, batch: Batch, z: Rows, scale: Numbers, iterations: int) -> RowsState:
        """L-BFGS from z on; `scale` (row,) is one over the curvature, 1 / s of the strongest mode if none is known."""
        return self.machine.descent.run(self._function(batch), self.machine.backend.as_real(z), scale, iterations)

    def coordinates(self, batch: Batch, state: RowsState) -> Rows:
        """V^H q of where the descent stands, (row, mode)."""
        return self.machine.backend.as_complex(state.x) / self.machine.root / batch.gain

    def _function(self, batch: Batch) -> Function:
        there, inverse = self.machine.backend, 1 / batch.gain
        xp, weight = there.xp, self.loudness
        heavy = weight * inverse

        def function(x: Rows) -> tuple[Numbers, Rows]:
            z = there.as_complex(x)
            cost, slope = self.machine.heard(batch, z @ self.out)
            q = inverse * (z @ self.loud)
            above = xp.clip(xp.real(q) ** 2 + xp.imag(q) ** 2 - 1, 0, None)
            gradient = slope @ self.out_back + heavy * ((above * q) @ self.loud_back)
            return cost + 0.25 * weight * squares(xp, above), there.as_real(gradient)

        return function
