"""Element-wise work of the batch solvers on a folded array, compiled by Numba: one pass over each row in the cache.

Import this module late: Numba takes a fifth of a second to load, and the first call compiles (cached on disk).
"""

# pyright: basic

from typing import Any

import numpy as np
from numba import njit

from midair.solvers.lbfgs import LBFGS

F = np.float32
_x = (np.pi / 2 * np.cos(np.pi * (np.arange(400) + 0.5) / 800)) ** 2
_sine = np.polynomial.polynomial.polyfit(_x, np.sinc(np.sqrt(_x) / np.pi), 4)
_cosine = np.polynomial.polynomial.polyfit(_x, np.cos(np.sqrt(_x)), 5)
S0, S1, S2, S3, S4 = (F(c) for c in _sine)
C0, C1, C2, C3, C4, C5 = (F(c) for c in _cosine)
PER_TURN, PI, HALF = F(1 / np.pi), F(np.pi), F(0.5)
compiled = njit(cache=True, fastmath=True, nogil=True)


@compiled
def spread(theta, real, imaginary, cosine, sine, kinds):
    """Drives exp(j theta), theta (row, layer, image, place), and the four kinds (kind, row, place) of their sum.

    The drives are first multiplied by the factors real + j imaginary (layer, image, place).
    """
    rows, layers, _, places = theta.shape
    K = kinds.view(np.float32)
    re, im = np.empty((4, places), np.float32), np.empty((4, places), np.float32)
    for row in range(rows):
        re[:], im[:] = 0, 0
        for layer in range(layers):
            for i in range(4):
                for n in range(places):
                    # theta = k pi + r with |r| up to pi / 2; the sign is that of odd and even k.
                    k = np.floor(theta[row, layer, i, n] * PER_TURN + HALF)
                    r = theta[row, layer, i, n] - k * PI
                    sign = F(1) - F(2) * (k - F(2) * np.floor(k * HALF))
                    u = r * r
                    s = sign * r * (S0 + u * (S1 + u * (S2 + u * (S3 + u * S4))))
                    c = sign * (C0 + u * (C1 + u * (C2 + u * (C3 + u * (C4 + u * C5)))))
                    cosine[row, layer, i, n], sine[row, layer, i, n] = c, s
                    re[i, n] += real[layer, i, n] * c - imaginary[layer, i, n] * s
                    im[i, n] += real[layer, i, n] * s + imaginary[layer, i, n] * c
        for part in range(2):
            x = im if part else re
            for n in range(places):
                e, f, g, h = x[0, n] + x[1, n], x[0, n] - x[1, n], x[2, n] + x[3, n], x[2, n] - x[3, n]
                K[0, row, 2 * n + part], K[1, row, 2 * n + part] = HALF * (e + g), HALF * (f + h)
                K[2, row, 2 * n + part], K[3, row, 2 * n + part] = HALF * (e - g), HALF * (f - h)


@compiled
def slope(kinds, real, imaginary, cosine, sine, gradient):
    """Im(conj(q) v), shape (row, layer, image, place), of the v that `kinds` (kind, row, place) are; see `spread`."""
    rows, layers, _, places = gradient.shape
    K = kinds.view(np.float32)
    re, im = np.empty((4, places), np.float32), np.empty((4, places), np.float32)
    for row in range(rows):
        for part in range(2):
            x = im if part else re
            for n in range(places):
                m = 2 * n + part
                e, f, g, h = (
                    K[0, row, m] + K[1, row, m],
                    K[0, row, m] - K[1, row, m],
                    K[2, row, m] + K[3, row, m],
                    K[2, row, m] - K[3, row, m],
                )
                x[0, n], x[1, n], x[2, n], x[3, n] = HALF * (e + g), HALF * (f + h), HALF * (e - g), HALF * (f - h)
        for layer in range(layers):
            for i in range(4):
                for n in range(places):
                    a, b = real[layer, i, n], imaginary[layer, i, n]
                    c, s = cosine[row, layer, i, n], sine[row, layer, i, n]
                    gradient[row, layer, i, n] = c * (a * im[i, n] - b * re[i, n]) - s * (a * re[i, n] + b * im[i, n])


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
    """`LBFGS` in single precision, with its vectors in one pass over each row; the function may reuse its results."""

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
