"""Many small minimisations at once: L-BFGS with one row of a matrix for each.

The rows know nothing of each other; they only share the calls of the function, which so become matrix products.
Nocedal & Wright, "Numerical Optimization", 2nd edition, algorithm 7.4, with one evaluation an iteration: a row whose
step fails the Armijo test stays where it is and tries a shorter step next time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.floating[Any]]
"""Shape (row, unknown), single or double precision."""
Numbers = NDArray[np.floating[Any]]
"""Shape (row,)."""
Function = Callable[[Rows], tuple[Numbers, Rows]]
"""x -> cost of each row, gradient of each row."""


@dataclass(slots=True, kw_only=True, eq=False)
class State:
    """Where all rows stand; `LBFGS.step` moves it on in place.

    Attributes
    ----------
    x, gradient : ndarray, shape (row, unknown)
        Place and slope.
    cost, scale, length : ndarray, shape (row,)
        Cost; first guess of the inverse Hessian; part of the full step to try next.
    pairs : list of (s, y, 1 / s.y)
        The last steps and changes of slope.
    iterations : int
        Evaluations after the first.
    """

    x: Rows
    gradient: Rows
    cost: Numbers
    scale: Numbers
    length: Numbers
    pairs: list[tuple[Rows, Rows, Numbers]]
    iterations: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class LBFGS:
    """Settings: how many pairs are kept, the slope that the Armijo test asks for, and how a step shrinks and grows."""

    memory: int = 4
    armijo: float = 1e-4
    shrink: float = 0.3
    grow: float = 3.0

    def begin(self, function: Function, x: Rows, step: Numbers) -> State:
        """The state at x; `step` (row,) is the length of the first step over that of the gradient."""
        cost, gradient = function(x)
        return State(x=x, gradient=gradient, cost=cost, scale=step, length=np.ones_like(cost), pairs=[])

    def step(self, function: Function, state: State) -> None:
        """One evaluation of all rows."""
        direction = _direction(state)
        slope = dot(direction, state.gradient)
        x = state.x + state.length[:, None] * direction
        cost, gradient = function(x)
        # Rounding of the cost itself must not count as a rise.
        slack = 4 * np.finfo(cost.dtype).eps * state.cost
        worse = ~(cost <= state.cost + self.armijo * state.length * slope + slack)
        self._remember(state, x - state.x, gradient - state.gradient)
        state.length = np.where(worse, self.shrink * state.length, np.minimum(1, self.grow * state.length))
        if worse.any():
            x[worse], cost[worse], gradient[worse] = state.x[worse], state.cost[worse], state.gradient[worse]
        state.x, state.cost, state.gradient = x, cost, gradient
        state.iterations += 1

    def run(self, function: Function, x: Rows, step: Numbers, iterations: int) -> State:
        """`iterations` steps from x."""
        state = self.begin(function, x, step)
        for _ in range(iterations):
            self.step(function, state)
        return state

    def _remember(self, state: State, s: Rows, y: Rows) -> None:
        """Keep the pair; where the curvature is not positive it counts as none."""
        sy, yy = dot(s, y), dot(y, y)
        curved = (sy > 1e-10 * yy) & (yy > 0)
        inverse = np.zeros_like(sy)
        np.divide(1, sy, out=inverse, where=curved)
        np.divide(sy, yy, out=state.scale, where=curved)
        state.pairs.append((s, y, inverse))
        del state.pairs[: -self.memory]


def dot(a: Rows, b: Rows) -> Numbers:
    """Inner product of each row, shape (row,)."""
    return np.einsum("rn,rn->r", a, b)


def _direction(state: State) -> Rows:
    """The two loops: minus the approximate inverse Hessian times the gradient."""
    d = -state.gradient
    weights: list[Numbers] = []
    for s, y, inverse in reversed(state.pairs):
        weight = inverse * dot(s, d)
        d -= weight[:, None] * y
        weights.append(weight)
    d *= state.scale[:, None]
    for (s, y, inverse), weight in zip(state.pairs, reversed(weights), strict=True):
        d += (weight - inverse * dot(y, d))[:, None] * s
    return d
