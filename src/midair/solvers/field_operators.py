"""The three steps of the batch solver (see `fast`): field, phase fit, refinement.

All arrays are those of the backend; a row is a frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Numbers, Rows, squares, taken
from midair.solvers.lbfgs import LBFGS, Function, RingLBFGS, RowsState
from midair.solvers.mirror_symmetry import KINDS, FoldedProduct, Product, modes_by_kind
from midair.solvers.modes import modes
from midair.solvers.phases import rippled
from midair.solvers.problem import Problem, cell_misfit, excess, misfit, phase_change


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Targets of some frames, scaled to norm 1, with the gain of the array that this needs.

    The cost is then E^2 / 2, and single precision is enough.
    """

    p: Rows  # Targets of norm 1, shape (row, point)
    gain: Rows  # One over the original norm, shape (row, 1)
    peak: Rows  # Largest of p, shape (row, 1)
    cells: Rows = None  # Target pressures of the cells, shape (row, cell), or None
    cell_scale: Numbers = None  # One over the squared norm of `cells`, shape (row,), or None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldOperators:
    """The matrices of one problem on a backend, and the steps.

    Listeners are the control points followed by the points of the guard; on a lattice, those of each image.
    """

    backend: Backend
    problem: Problem
    field: Product  # (U diag(s) A)^T, from V^H q to the field, shape (mode, listener)
    points: Product  # The same to the control points alone
    drive: Product  # V transposed, shape (mode, transducer)
    root: Numbers  # Square roots of A s, shape (mode,)
    strongest: float  # Largest singular value times A
    psi: Numbers  # exp j psi, initial phases of the field, shape (point,)
    initial_drive: Rows  # The drive that all frames start from, shape (1, transducer)
    weights: Rows  # Weights of the cells, shape (point, cell), or None
    ceiling: Rows  # Ceiling of the guard, shape (1, guard point), or None
    memory: int  # Number of pairs that L-BFGS keeps

    @classmethod
    def of(
        cls, problem: Problem, backend: Backend, *, tolerance: float, memory: int, outside: float = 1.0
    ) -> "FieldOperators":
        """Compute the matrices, in double precision, from the modes above `tolerance` of the strongest.

        `outside` is the weight of guard points relative to control points in the choice of modes: a field that shall
        only be quiet needs less precision.
        """
        lattice, guard, psi = problem.lattice, problem.guard, np.exp(1j * problem.first_psi)
        # On a lattice the field at the first image of the points gives that at all.
        images = 1 if lattice is None else 4
        points = problem.points // images
        listeners, weighted = problem.G[:points], images**0.5 * problem.G[:points]
        if guard is not None:
            ring = guard.G[: len(guard.G) // images]
            listeners = np.concatenate([listeners, ring])
            weighted = np.concatenate([weighted, images**0.5 * outside * ring])
        if lattice is not None:
            strength, kinds = modes_by_kind(weighted, tolerance)
            drives = np.einsum("ki,kmn->inkm", KINDS, kinds).reshape(-1, len(strength))
            drive: Product = FoldedProduct.of(backend, kinds / 2, lattice.weight)
            first = psi @ (problem.G @ drives).conj() / strength
        else:
            kept = modes(weighted, tolerance=tolerance)
            strength, drives, matrix = kept.s, kept.V, backend.put(kept.V.T)
            drive = Product(backend=backend, matrix=matrix, back=backend.adjoint(matrix))
            first = psi @ kept.U[: problem.points].conj()
        s = problem.level * strength
        first_drive = (first / np.where(s > 0, s, 1)) @ drives.T
        made = problem.level * (listeners @ drives).T
        if lattice is None:
            matrix = backend.put(made)
            field = Product(backend=backend, matrix=matrix, back=backend.adjoint(matrix))
        else:
            field = FoldedProduct.of(backend, made.reshape(4, -1, len(listeners)))
        root = backend.put(np.sqrt(s))
        return cls(
            backend=backend,
            problem=problem,
            field=field,
            points=field.sampled(np.arange(points), backend.xp.ones_like(root)),
            drive=drive,
            root=root,
            strongest=float(s.max()),
            psi=backend.put(psi),
            initial_drive=backend.put(rippled(first_drive)[None, :]),
            weights=None if problem.cells is None else backend.put(problem.cells.weights.T),
            ceiling=None if guard is None else backend.put(guard.ceilings.reshape(images, -1)),
            memory=memory,
        )

    def batch(self, frames: NDArray[np.int64], *, faintest: float) -> Batch:
        """The targets of these frames; norms below `faintest` are replaced by it."""
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
        move = self.field_move(loudness=loudness, floor=floor, sampled=np.arange(0, self.problem.transducers, every))
        one = self.backend.xp.ones_like(batch.gain[:, 0])
        state = move.run(batch, move.first(batch.p * self.psi), one / self.strongest, iterations)
        return move.coordinates(batch, state)

    def field_move(
        self, *, loudness: float, floor: float, sampled: NDArray[np.int64], effort: float = 0.0
    ) -> "FieldMove":
        """The field step; `loudness` is the weight of amplitudes above full drive at the `sampled` columns of `drive`.

        `effort` is the weight of the squared length of V^H q, in units of a target in the strongest mode.
        """
        # Convergence is best in z = sqrt(s) a, for strong and weak modes; a and s a are both slower.
        loud = self.drive.sampled(sampled, self.root)
        return FieldMove(
            operators=self,
            out=self.field.sampled(np.arange(self.field.shape[1] // self.field.images), self.root),
            loud=loud,
            loudness=loudness / loud.shape[1],
            pseudo=self.root / (self.root**4 + (floor * self.strongest) ** 2),
            effort=effort * (self.strongest / self.root) ** 2 if effort else None,
        )

    @property
    def descent(self) -> LBFGS:
        """The implementation: `LBFGS` for NumPy, `RingLBFGS` for others."""
        method = LBFGS if self.backend.xp is np else RingLBFGS
        return method(memory=self.memory, xp=self.backend.xp)

    def phase_fit(self, a: Rows, iterations: int, *, relaxation: float) -> Rows:
        """Phases of drives of equal amplitude with V^H q close to a, (row, transducer), in rad.

        All rows start at the same drive, so the components that no point measures stay similar from frame to frame.
        """
        xp, q = self.backend.xp, self.initial_drive
        for _ in range(iterations):
            q = self.backend.unit(q + relaxation * self.drive.of_modes(a - self.drive.to_modes(q)))
        return self.backend.angle(xp.broadcast_to(q, (a.shape[0], q.shape[1])))

    def reachable(self, a: Rows, max_power_share: float) -> NDArray[np.bool_]:
        """Which rows of a field a, V^H q (row, mode), drives of equal amplitude can come close to, shape (row,).

        True where the minimum-norm drive needs at most this fraction of the array's power.
        """
        xp = self.backend.xp
        power = xp.real(xp.vecdot(a, a)) / self.drive.shape[1]
        return np.asarray(self.backend.get(power) <= max_power_share)

    def admm(self, batch: Batch, a: Rows, q: Rows, iterations: int, *, stiffness: float, relaxation: float) -> Rows:
        """ADMM between the target field a and b = V^H q, the field of the phases; u is the dual variable.

        Boyd et al., "Distributed optimization and statistical learning via the alternating direction method of
        multipliers", 2011, section 3.1.1, with one step each towards a and q; control points only. a (row, mode) is the
        initial field, q (row, transducer) a drive of magnitude 1 close to it; `stiffness` is the penalty relative to
        the strongest mode, `relaxation` 1 to 2 applies to the step towards q. Returns q.
        """
        backend, s = self.backend, self.root**2
        weight = (stiffness * self.strongest * batch.gain) ** 2
        inverse = 1 / ((s * batch.gain) ** 2 + weight)
        b, u = self.drive.to_modes(q), 0 * a
        for _ in range(iterations):
            y = self.points.of_modes(batch.gain * a)
            wanted = self.points.to_modes(batch.gain * (batch.p * backend.unit(y)))
            a = (wanted + weight * (b - u)) * inverse
            # Less than the full step of the dual, which at few iterations overshoots.
            u = u + 0.8 * (a - b)
            q = backend.unit(q + relaxation * self.drive.of_modes(a + u - b))
            b = self.drive.to_modes(q)
        return q

    def refine(self, theta: Rows, batch: Batch, iterations: int, *, more: int) -> Rows:
        """Minimise the error from theta on, (row, transducer), with `more` iterations for the worst quarter."""
        xp, method = self.backend.xp, self.descent
        step = 1 / (self.strongest * batch.gain[:, 0]) ** 2
        state = method.run(self.phase_function(batch), theta, step, iterations)
        if not more:
            return state.x
        order = xp.argsort(state.cost)
        # The quarter is rounded up, so that a single frame counts as worst.
        good = theta.shape[0] - (theta.shape[0] + 3) // 4
        worst = order[good:]
        x, scale = xp.take(state.x, worst, axis=0), xp.take(state.scale, worst)
        better = method.run(self.phase_function(taken(xp, batch, worst)), x, scale, more).x
        sorted_x = xp.concat([xp.take(state.x, order[:good], axis=0), better], axis=0)
        return xp.take(sorted_x, xp.argsort(order), axis=0)

    def refine_together(self, theta: Rows, batch: Batch, before: Rows, iterations: int) -> Rows:
        """Minimise the errors and the costs of the phases of all rows at once, from theta on, (row, transducer).

        One descent for the whole batch, since each row depends on its neighbours. The cost of a faint frame is steeper
        by the square of its gain; its unknown is the phase over a factor between .01 and 1, so that one step
        length suits all. `before` (1, transducer) is the fixed drive before the first frame, zero if there is none.
        """
        xp, shape = self.backend.xp, theta.shape
        least = xp.min(batch.gain)
        part = xp.clip(least / batch.gain, 1e-2, None)
        alone = self.phase_function(batch)

        def function(x: Rows) -> tuple[Numbers, Rows]:
            here = part * xp.reshape(x, shape)
            cost, gradient = alone(here)
            q = self.backend.phasor(here)
            extra, pull = phase_change(xp, q, before, self.problem.smooth)
            cost, gradient = cost + extra, gradient + pull
            return xp.reshape(xp.sum(cost), (1,)), xp.reshape(part * gradient, (1, -1))

        step = xp.reshape(1 / (self.strongest * least) ** 2, (1,))
        start = xp.reshape(theta / part, (1, -1))
        x = self.descent.run(function, start, step, iterations).x
        return part * xp.reshape(x, shape)

    def phase_function(self, batch: Batch) -> Function:
        """The function of theta that returns cost and gradient, row by row.

        With r the slope of the cost by the field, its gradient by theta_n is Im(conj(q_n) (G^H r)_n).
        """
        gain = batch.gain

        def function(theta: Rows) -> tuple[Numbers, Rows]:
            q, a = self.drive.phasors(theta)
            cost, slope = self.cost_and_slope(batch, self.field.of_modes(gain * a))
            return cost, self.drive.slope(q, gain * self.field.to_modes(slope))

        return function

    def cost_and_slope(self, batch: Batch, y: Rows) -> tuple[Numbers, Rows]:
        """Cost of the field y (row, listener), which may be overwritten, and its slope by y."""
        xp, guard, (rows, points) = self.backend.xp, self.problem.guard, batch.p.shape
        size = xp.reshape(xp.abs(y), (rows, self.field.images, -1))
        each = points // self.field.images
        inside = xp.reshape(size[:, :, :each], (rows, points))
        if batch.cells is None:
            cost, factor = misfit(xp, inside, batch.p)
        else:
            cost, factor = cell_misfit(xp, inside, self.weights, batch.cells, batch.cell_scale)
        if guard is not None:
            extra, outside = excess(xp, size[:, :, each:], self.ceiling * batch.peak[:, :, None], guard.weight)
            cost = cost + extra
            factor = xp.concat([xp.reshape(factor, (rows, self.field.images, each)), outside], axis=2)
        y *= xp.reshape(factor, y.shape)
        return cost, y


def in_order(backend: Backend, parts: list[tuple[NDArray[np.int64], Rows]]) -> Rows:
    """Concatenate rows that were computed separately, in the order of their indices."""
    if len(parts) == 1:
        return parts[0][1]
    order = backend.put(np.argsort(np.concatenate([rows for rows, _ in parts])))
    return backend.xp.take(backend.xp.concat([part for _, part in parts], axis=0), order, axis=0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMove:
    """The field step: the best field with free amplitudes, in the coordinates of the modes.

    A row of z is sqrt(s) V^H q in units of the row's target, so that it follows a change of the overall level.
    """

    operators: FieldOperators
    out: Product  # From z to the listeners, shape (mode, listener)
    loud: Product  # From z to the sampled transducers: drives of r modes are smooth, so a sample is enough
    loudness: float  # Weight of amplitudes above full drive, per sampled transducer
    pseudo: Numbers  # Damped inverse from the field at the points to z, shape (mode,)
    effort: Numbers = None  # Weight of |z|^2 / 2, shape (mode,), or None

    def first(self, y: Rows) -> Rows:
        """The z whose field at the control points comes close to y, (row, point): root s U^H y / (s^2 + floor^2)."""
        return self.operators.points.to_modes(y) * self.pseudo

    def run(self, batch: Batch, z: Rows, scale: Numbers, iterations: int) -> RowsState:
        """L-BFGS from z on; `scale` (row,) is the inverse curvature, 1 / s of the strongest mode if unknown."""
        return self.operators.descent.run(self._function(batch), self.operators.backend.as_real(z), scale, iterations)

    def coordinates(self, batch: Batch, state: RowsState) -> Rows:
        """V^H q at the state of the descent, (row, mode)."""
        return self.operators.backend.as_complex(state.x) / self.operators.root / batch.gain

    def _function(self, batch: Batch) -> Function:
        backend, inverse = self.operators.backend, 1 / batch.gain
        xp, weight = backend.xp, self.loudness
        heavy = weight * inverse

        def function(x: Rows) -> tuple[Numbers, Rows]:
            z = backend.as_complex(x)
            cost, slope = self.operators.cost_and_slope(batch, self.out.of_modes(z))
            gradient = self.out.to_modes(slope)
            if weight:
                q = inverse * self.loud.of_modes(z)
                above = xp.maximum(xp.real(q) ** 2 + xp.imag(q) ** 2 - 1, 0)
                gradient = gradient + heavy * self.loud.to_modes(above * q)
                cost = cost + 0.25 * weight * squares(xp, above)
            if self.effort is not None:
                pull = self.effort * z
                gradient = gradient + pull
                cost = cost + 0.5 * xp.real(xp.vecdot(z, pull))
            return cost, backend.as_real(gradient)

        return function


def evenly_spread(position: NDArray[np.float64] | None, *, every: int, count: int) -> NDArray[np.int64]:
    """Indices of one in `every` transducers, evenly over the array: each next is the farthest from those before it.

    If the positions are unknown, every `every`-th.
    """
    if position is None:
        return np.arange(0, count, every)
    chosen = [int(position[:, :2].sum(axis=1).argmin())]
    distance = np.full(count, np.inf)
    while len(chosen) < max(count // every, 1):
        distance = np.minimum(distance, ((position - position[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distance.argmax()))
    return np.sort(np.array(chosen))
