"""Many small minimisations at once: L-BFGS with one row of a matrix for each.

The rows know nothing of each other; they only share the calls of the function, which so become matrix products.
Nocedal & Wright, "Numerical Optimization", 2nd edition, algorithm 7.4, with one evaluation an iteration: a row whose
step fails the Armijo test stays where it is and tries a shorter step next time.

The arrays are those of any library of the array API standard.
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
    """Where all rows stand; `LBFGS.step` moves it on in place.

    Attributes
    ----------
    x, gradient : array, shape (row, unknown)
        Place and slope.
    cost, scale, length : array, shape (row,)
        Cost; first guess of the inverse Hessian; part of the full step to try next.
    pairs : list of (s, y, 1 / s.y)
        The last steps and changes of slope.
    iterations : int
        Evaluations after the first.
    ring : Ring or None
        What `device.RingLBFGS` has in place of pairs.
    """

    x: Rows
    gradient: Rows
    cost: Numbers
    scale: Numbers
    length: Numbers
    pairs: list[tuple[Rows, Rows, Numbers]]
    iterations: int = 0
    ring: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LBFGS:
    """Settings of the method.

    Attributes
    ----------
    memory : int
        Pairs that are kept.
    armijo : float
        Part of the promised fall that a step must bring.
    shrink, grow : float
        How a step changes after one that failed, and after one that did not.
    xp : module
        The functions of the array API standard, for the arrays that come.
    """

    memory: int = 4
    armijo: float = 1e-4
    shrink: float = 0.3
    grow: float = 3.0
    xp: Any = np

    def begin(self, function: Function, x: Rows, step: Numbers) -> RowsState:
        """The state at x; `step` (row,) is the length of the first step over that of the gradient."""
        cost, gradient = function(x)
        return RowsState(x=x, gradient=gradient, cost=cost, scale=step, length=self.xp.ones_like(cost), pairs=[])

    def step(self, function: Function, state: RowsState) -> None:
        """One evaluation of all rows."""
        xp = self.xp
        direction = self._direction(state)
        slope = self._dot(direction, state.gradient)
        s = state.length[:, None] * direction
        x = state.x + s
        cost, gradient = function(x)
        # Rounding of the cost itself must not count as a rise.
        slack = 4 * xp.finfo(cost.dtype).eps * state.cost
        better = cost <= state.cost + self.armijo * state.length * slope + slack
        # Before the step is judged: one that failed has shown how the slope changes, too.
        self._remember(state, s, gradient - state.gradient)
        # Up to the full step, which is the method's own; longer ones have no reason.
        state.length = xp.where(better, xp.clip(self.grow * state.length, None, 1), self.shrink * state.length)
        # Nearly always all rows are better, and the choice would cost three copies; elsewhere the question is a wait.
        if xp is not np or not better.all():
            kept = better[:, None]
            x, cost = xp.where(kept, x, state.x), xp.where(better, cost, state.cost)
            gradient = xp.where(kept, gradient, state.gradient)
        state.x, state.cost, state.gradient = x, cost, gradient
        state.iterations += 1

    def run(self, function: Function, x: Rows, step: Numbers, iterations: int) -> RowsState:
        """`iterations` steps from x."""
        state = self.begin(function, x, step)
        for _ in range(iterations):
            self.step(function, state)
        return state

    def _dot(self, a: Rows, b: Rows) -> Numbers:
        """Inner product of each row, shape (row,)."""
        return self.xp.vecdot(a, b)

    def _remember(self, state: RowsState, s: Rows, y: Rows) -> None:
        """Keep the pair; where the curvature is not positive it counts as none."""
        xp = self.xp
        sy, yy = self._dot(s, y), self._dot(y, y)
        # A pair of no positive curvature would turn later directions uphill.
        curved = (sy > 1e-10 * yy) & (yy > 0)
        one = xp.ones_like(sy)
        inverse = xp.where(curved, 1 / xp.where(curved, sy, one), 0 * one)
        # The size of the inverse Hessian along the last step (Nocedal & Wright, eq. 7.20).
        state.scale = xp.where(curved, sy / xp.where(curved, yy, one), state.scale)
        state.pairs.append((s, y, inverse))
        del state.pairs[: -self.memory]

    def _direction(self, state: RowsState) -> Rows:
        """The two loops: minus the approximate inverse Hessian times the gradient."""
        d = -state.gradient
        weights: list[Numbers] = []
        for s, y, inverse in reversed(state.pairs):
            weight = inverse * self._dot(s, d)
            d -= weight[:, None] * y
            weights.append(weight)
        d *= state.scale[:, None]
        for (s, y, inverse), weight in zip(state.pairs, reversed(weights), strict=True):
            d += (weight - inverse * self._dot(y, d))[:, None] * s
        return d
