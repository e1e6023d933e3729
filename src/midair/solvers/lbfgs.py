"""L-BFGS for many small minimisations at once, one per row of a matrix.

The rows are independent, but share each evaluation of the function, so that it consists of matrix products. Nocedal &
Wright, "Numerical Optimization", 2nd edition, algorithm 7.4, with one evaluation per iteration: a row whose step fails
the Armijo test stays in place and tries a shorter step next time. Arrays may be those of any library of the array API
standard.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.solvers.backend import Numbers, Rows

Function = Callable[[Rows], tuple[Numbers, Rows]]
"""x -> cost of each row, gradient of each row."""


@dataclass(slots=True, kw_only=True, eq=False)
class RowsState:
    """State of all rows; `LBFGS.step` updates it in place."""

    x: Rows  # Unknowns, shape (row, unknown)
    gradient: Rows
    cost: Numbers  # Shape (row,)
    scale: Numbers  # Initial guess of the inverse Hessian, shape (row,)
    length: Numbers  # Fraction of the full step to try next, shape (row,)
    pairs: list[tuple[Rows, Rows, Numbers]]  # The last steps s, changes of gradient y, and 1 / s.y
    iterations: int = 0  # Evaluations after the first
    ring: Any = None  # The `Ring` of `RingLBFGS`, which replaces the pairs


@dataclass(frozen=True, slots=True, kw_only=True)
class LBFGS:
    """Settings of the method."""

    memory: int = 4  # Number of pairs that are kept
    armijo: float = 1e-4  # Fraction of the predicted decrease that a step must reach
    shrink: float = 0.3  # Factor on the step length after a rejected step
    grow: float = 3.0  # Factor on the step length after an accepted step
    xp: Any = np  # Module with the functions of the array API standard

    def begin(self, function: Function, x: Rows, step: Numbers) -> RowsState:
        """The state at x; `step` (row,) is the length of the first step over that of the gradient."""
        cost, gradient = function(x)
        return RowsState(x=x, gradient=gradient, cost=cost, scale=step, length=self.xp.ones_like(cost), pairs=[])

    def step(self, function: Function, state: RowsState) -> None:
        """Evaluate all rows once and update the state."""
        xp = self.xp
        direction = self._direction(state)
        slope = self.xp.vecdot(direction, state.gradient)
        s = state.length[:, None] * direction
        x = state.x + s
        cost, gradient = function(x)
        # A rise within the rounding error of the cost is accepted.
        slack = 4 * xp.finfo(cost.dtype).eps * state.cost
        better = cost <= state.cost + self.armijo * state.length * slope + slack
        # Also for rejected steps, which carry information about the curvature.
        self._remember(state, s, gradient - state.gradient)
        # At most the full step of the method.
        state.length = xp.where(better, xp.minimum(self.grow * state.length, 1), self.shrink * state.length)
        worse = ~better
        if xp.any(worse):
            x[worse], cost[worse], gradient[worse] = state.x[worse], state.cost[worse], state.gradient[worse]
        state.x, state.cost, state.gradient = x, cost, gradient
        state.iterations += 1

    def run(self, function: Function, x: Rows, step: Numbers, iterations: int) -> RowsState:
        """Make `iterations` steps from x."""
        state = self.begin(function, x, step)
        for _ in range(iterations):
            self.step(function, state)
        return state

    def _remember(self, state: RowsState, s: Rows, y: Rows) -> None:
        """Keep the pair; its weight is 0 where the curvature is not positive."""
        xp = self.xp
        sy, yy = self.xp.vecdot(s, y), self.xp.vecdot(y, y)
        # A pair without positive curvature could make later directions uphill.
        curved = (sy > 1e-10 * yy) & (yy > 0)
        inverse = 1 / xp.where(curved, sy, xp.inf)
        # The size of the inverse Hessian along the last step (Nocedal & Wright, eq. 7.20).
        state.scale = xp.where(curved, sy / xp.where(curved, yy, xp.inf), state.scale)
        state.pairs.append((s, y, inverse))
        del state.pairs[: -self.memory]

    def _direction(self, state: RowsState) -> Rows:
        """Two-loop recursion: minus the approximate inverse Hessian times the gradient."""
        d = -state.gradient
        weights: list[Numbers] = []
        for s, y, inverse in reversed(state.pairs):
            weight = inverse * self.xp.vecdot(s, d)
            d -= weight[:, None] * y
            weights.append(weight)
        d *= state.scale[:, None]
        for (s, y, inverse), weight in zip(state.pairs, reversed(weights), strict=True):
            d += (weight - inverse * self.xp.vecdot(y, d))[:, None] * s
        return d


@dataclass(slots=True, kw_only=True, eq=False)
class Ring:
    """The pairs of all rows in a ring buffer; `turn` overwrites the oldest."""

    vectors: Rows  # S, Y and the gradient, shape (row, 2 memory + 1, unknown)
    gram: Rows  # Their inner products, shape (row, 2 memory + 1, 2 memory + 1)
    inverse: Rows  # R^-1, shape (row, memory, memory); 0 in the rows and columns of ignored pairs
    minus: Numbers  # -1, shape (row, 1)
    nothing: Numbers  # Infinity, shape (), whose inverse is 0
    memory: int  # Number of pairs
    slot: int = 0  # Index of the next pair

    @classmethod
    def of(cls, xp: Any, gradient: Rows, memory: int) -> "Ring":
        """A ring without pairs."""
        rows, unknowns = gradient.shape
        alike = {"dtype": gradient.dtype, "device": gradient.device}
        vectors = xp.zeros((rows, 2 * memory + 1, unknowns), **alike)
        vectors[:, 2 * memory, :] = gradient
        return cls(
            vectors=vectors,
            gram=_gram(xp, vectors),
            inverse=xp.zeros((rows, memory, memory), **alike),
            minus=-xp.ones((rows, 1), **alike),
            nothing=xp.full((), xp.inf, **alike),
            memory=memory,
        )

    @property
    def gradient(self) -> Rows:
        """The current gradient, (row, unknown): a view."""
        return self.vectors[:, 2 * self.memory, :]

    def direction(self, xp: Any, scale: Numbers) -> Rows:
        """Coefficients of the vectors in the step over scale, shape (row, 2 memory + 1)."""
        m, gram, turned = self.memory, self.gram, xp.matrix_transpose(self.inverse)
        pull = gram[:, : 2 * m, 2 * m :]
        a = self.inverse @ pull[:, :m, :]
        curvature = xp.linalg.diagonal(gram[:, :m, m : 2 * m])[:, :, None]
        left = pull[:, m:, :] - gram[:, m : 2 * m, m : 2 * m] @ a
        c = turned @ (left - curvature * a / scale[:, None, None])
        return xp.concat([c[:, :, 0], a[:, :, 0], self.minus], axis=1)

    def turn(self, xp: Any, s: Rows, gradient: Rows, kept: Rows, scale: Numbers) -> Numbers:
        """Store a pair, and the gradient of the rows that are `kept`; returns the new scale."""
        m, slot, vectors = self.memory, self.slot, self.vectors
        vectors[:, slot, :] = s
        vectors[:, m + slot, :] = gradient - self.gradient
        vectors[:, 2 * m, :] = xp.where(kept, gradient, self.gradient)
        gram = self.gram = _gram(xp, vectors)
        sy, yy = gram[:, slot, m + slot], gram[:, m + slot, m + slot]
        # As in `LBFGS`: a pair without positive curvature could make later directions uphill.
        curved = (sy > 1e-10 * yy) & (yy > 0)
        inverse = 1 / xp.where(curved, sy, self.nothing)
        self.inverse[:, slot, :] = 0
        self.inverse[:, :, slot] = 0
        column = self.inverse[:, :, slot]
        # In place on a view, which all libraries here support.
        column -= inverse[:, None] * (self.inverse @ gram[:, :m, m + slot, None])[:, :, 0]
        self.inverse[:, slot, slot] = inverse
        self.slot = (slot + 1) % m
        return xp.where(curved, sy / xp.where(curved, yy, self.nothing), scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLBFGS(LBFGS):
    """`LBFGS` on a ring buffer: the same steps except for rounding, with few launches and no synchronisation on a GPU.

    For any library but NumPy. All pairs of a row and its gradient are one array, written in place. One batched product
    gives all inner products of a row; the two-loop recursion becomes algebra on a few numbers per row, and a second
    batched product makes the step. With P the columns [S Y g], R the part of S^T Y on and above the diagonal, D its
    diagonal and h the scale (Byrd, Nocedal & Schnabel, "Representations of quasi-Newton matrices", Math. Programming 63
    (1994), eq. 3.1),

        a = R^-1 S^T g,  c = R^-T (h (Y^T g - Y^T Y a) - D a),  step = S c + h (Y a - g).

    R^-1 is updated without solving: a new pair adds a column; to drop the oldest pair, its row and column are deleted.
    Rows of R are in the order of the slots, so R is triangular up to a permutation.
    """

    def step(self, function: Function, state: RowsState) -> None:
        """Evaluate all rows once and update the state."""
        xp = self.xp
        ring = state.ring
        if ring is None:
            ring = state.ring = Ring.of(xp, state.gradient, self.memory)
        made_of = (state.length * state.scale)[:, None] * ring.direction(xp, state.scale)
        promised = xp.sum(made_of * ring.gram[:, 2 * self.memory, :], axis=1)
        s = (made_of[:, None, :] @ ring.vectors)[:, 0, :]
        x = state.x + s
        cost, gradient = function(x)
        # A rise within the rounding error of the cost is accepted.
        better = cost <= (1 + 4 * xp.finfo(cost.dtype).eps) * state.cost + self.armijo * promised
        kept = better[:, None]
        # Testing whether all rows are better would wait for the GPU to finish.
        state.scale = ring.turn(xp, s, gradient, kept, state.scale)
        state.x, state.cost = xp.where(kept, x, state.x), xp.where(better, cost, state.cost)
        state.length = xp.where(better, xp.minimum(self.grow * state.length, 1), self.shrink * state.length)
        state.gradient = ring.gradient
        state.iterations += 1


def _gram(xp: Any, vectors: Rows) -> Rows:
    return vectors @ xp.matrix_transpose(vectors)
