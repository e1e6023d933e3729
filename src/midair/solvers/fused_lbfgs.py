"""L-BFGS of the batch solvers compiled by Numba: one pass over each row in the cache.

Import this module late: Numba takes a fifth of a second to load, and the first call compiles (cached on disk).
"""

# pyright: basic

from typing import Any

import numpy as np
from numba import njit

from midair.solvers.lbfgs import LBFGS

F = np.float32
compiled = njit(cache=True, fastmath=True, nogil=True)


@compiled
def _trials(x, g, S, Y, inverse, count, scale, length, trial, fall):
    """Two-loop recursion of each row: trial = x + length d, and the slope along d."""
    memory, n = len(S), x.shape[1]
    d, held = np.empty(n, np.float32), np.empty(memory, np.float32)
    first = max(count - memory, 0)
    for row in range(len(x)):
        for i in range(n):
            d[i] = -g[row, i]
        for j in range(count - 1, first - 1, -1):
            s, y, total = S[j % memory, row], Y[j % memory, row], F(0)
            for i in range(n):
                total += s[i] * d[i]
            w = inverse[j % memory, row] * total
            held[j % memory] = w
            for i in range(n):
                d[i] -= w * y[i]
        for i in range(n):
            d[i] *= scale[row]
        for j in range(first, count):
            s, y, total = S[j % memory, row], Y[j % memory, row], F(0)
            for i in range(n):
                total += y[i] * d[i]
            w = held[j % memory] - inverse[j % memory, row] * total
            for i in range(n):
                d[i] += w * s[i]
        total = F(0)
        for i in range(n):
            total += d[i] * g[row, i]
            trial[row, i] = x[row, i] + length[row] * d[i]
        fall[row] = total


@compiled
def _judge(x, g, cost, trial, gradient, new, S, Y, inverse, at, scale, length, fall, limits):
    """Keep the pair of each row, and the trial where its cost is low enough."""
    (armijo, shrink, grow), n = limits, x.shape[1]
    for row in range(len(x)):
        s, y, sy, yy = S[at, row], Y[at, row], F(0), F(0)
        for i in range(n):
            a, b = trial[row, i] - x[row, i], gradient[row, i] - g[row, i]
            s[i], y[i] = a, b
            sy += a * b
            yy += b * b
        inverse[at, row] = 0
        if yy > 0 and sy > F(1e-10) * yy:
            inverse[at, row], scale[row] = F(1) / sy, sy / yy
        if new[row] <= cost[row] + armijo * length[row] * fall[row] + F(4.8e-7) * cost[row]:
            cost[row], length[row] = new[row], min(grow * length[row], F(1))
            for i in range(n):
                x[row, i], g[row, i] = trial[row, i], gradient[row, i]
        else:
            length[row] *= shrink


class FusedLBFGS(LBFGS):
    """`LBFGS` in single precision, with its vectors in one pass over each row."""

    __slots__ = ()

    def begin(self, function: Any, x: Any, step: Any) -> Any:
        """The state at x, which keeps copies."""
        state = LBFGS.begin(self, function, np.array(x), np.array(step, F))
        state.gradient, state.cost = np.array(state.gradient), np.array(state.cost, F)
        return state

    def step(self, function: Any, state: Any) -> None:
        """Evaluate all rows once and update the state."""
        x, m = state.x, self.memory
        if state.ring is None:
            pairs: Any = [np.empty((m, *x.shape), F), np.empty((m, *x.shape), F), np.empty((m, len(x)), F)]
            state.ring = pairs, np.empty_like(x), np.empty(len(x), F)
        (S, Y, inverse), trial, fall = state.ring
        _trials(x, state.gradient, S, Y, inverse, state.iterations, state.scale, state.length, trial, fall)
        new, gradient = function(trial)
        g, cost, scale, length = state.gradient, state.cost, state.scale, state.length
        limits = (F(self.armijo), F(self.shrink), F(self.grow))
        _judge(x, g, cost, trial, gradient, new, S, Y, inverse, state.iterations % m, scale, length, fall, limits)
        state.iterations += 1
