"""Loops of the folded batch solver on NumPy in single precision, compiled by Numba; import this module late.

One pass over each row in place of several over the whole batch; the matrix products between them are NumPy's.
"""

# pyright: basic

import numpy as np
from numba import njit

# Not "nnan" and "ninf": a step that overflows is found by its cost.
_fused = njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "arcp", "nsz"})


@_fused
def _mirror(x, y):
    """Write into y twice the even and odd parts of x under the mirrors, both (image or kind, number)."""
    for n in range(x.shape[1]):
        a, b, c, d = x[0, n], x[1, n], x[2, n], x[3, n]
        y[0, n], y[1, n] = (a + b) + (c + d), (a - b) + (c - d)
        y[2, n], y[3, n] = (a + b) - (c + d), (a - b) - (c - d)


@_fused
def spread(cosine, sine, weight, kinds):
    """Write into kinds (row, kind, place) the parts of drives of these angles (row, image, place) and weights."""
    q = np.empty((4, kinds.shape[2]), np.complex64)
    for row in range(len(cosine)):
        for i in range(4):
            for n in range(q.shape[1]):
                q[i, n] = complex(weight[i, n] * cosine[row, i, n], weight[i, n] * sine[row, i, n])
        _mirror(q, kinds[row])


@_fused
def turn(kinds, cosine, sine, weight, slope):
    """Write into slope (row, image, place) the imaginary part of conj(q) v, with v given by its parts `kinds`."""
    v = np.empty((4, kinds.shape[2]), np.complex64)
    for row in range(len(cosine)):
        _mirror(kinds[row], v)
        for i in range(4):
            for n in range(v.shape[1]):
                across = cosine[row, i, n] * v[i, n].imag - sine[row, i, n] * v[i, n].real
                slope[row, i, n] = weight[i, n] * across


@_fused
def aim(x, gradient, S, Y, inverse, count, scale, length, trial, slope):
    """The two loops of L-BFGS (Nocedal & Wright, algorithm 7.4) row by row: trial = x + length times direction.

    S and Y (row, pair, unknown) and inverse (row, pair) are ring buffers of `count` pairs; slope (row,) becomes the
    slope of the cost along the direction.
    """
    memory, unknowns = S.shape[1:]
    held = np.empty(memory, np.float32)
    for row in range(len(x)):
        d = -gradient[row]
        for j in range(count - 1, max(count - memory, 0) - 1, -1):
            s, y, total = S[row, j % memory], Y[row, j % memory], np.float32(0)
            for i in range(unknowns):
                total += s[i] * d[i]
            held[j % memory] = inverse[row, j % memory] * total
            for i in range(unknowns):
                d[i] -= held[j % memory] * y[i]
        for i in range(unknowns):
            d[i] *= scale[row]
        for j in range(max(count - memory, 0), count):
            s, y, total = S[row, j % memory], Y[row, j % memory], np.float32(0)
            for i in range(unknowns):
                total += y[i] * d[i]
            weight = held[j % memory] - inverse[row, j % memory] * total
            for i in range(unknowns):
                d[i] += weight * s[i]
        total = np.float32(0)
        for i in range(unknowns):
            total += d[i] * gradient[row, i]
            trial[row, i] = x[row, i] + length[row] * d[i]
        slope[row] = total


@_fused
def accept(trial, new, pull, slope, x, cost, gradient, S, Y, inverse, at, scale, length, settings):
    """Keep the pair at `at`, and each row's trial with cost `new` and gradient `pull` if it passes the Armijo test."""
    armijo, shrink, grow, slack = settings
    for row in range(len(x)):
        s, y, sy, yy = S[row, at], Y[row, at], np.float32(0), np.float32(0)
        for i in range(x.shape[1]):
            a, b = trial[row, i] - x[row, i], pull[row, i] - gradient[row, i]
            s[i], y[i] = a, b
            sy += a * b
            yy += b * b
        curved = yy > 0 and sy > np.float32(1e-10) * yy
        inverse[row, at] = np.float32(1) / sy if curved else np.float32(0)
        if curved:
            scale[row] = sy / yy
        if new[row] <= (np.float32(1) + slack) * cost[row] + armijo * length[row] * slope[row]:
            cost[row], length[row] = new[row], min(grow * length[row], np.float32(1))
            for i in range(x.shape[1]):
                x[row, i], gradient[row, i] = trial[row, i], pull[row, i]
        else:
            length[row] *= shrink
