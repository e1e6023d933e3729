"""The inner loop of the live solver, compiled by Numba: fixed work, no allocation.

Import it late: Numba takes a second to load, and the first call compiles (kept on disk for the next run).
"""

# pyright: basic

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True)
def cost_and_slope(z, p, gain, out, drive, weight, y, q, conjugate, g):
    """Write the gradient by z into g and return the cost; see `fast._Machine._field`.

    z, g (mode,); p, y (point,); out (mode, point); drive, conjugate-free q (some transducers,); all single precision.
    """
    np.dot(out.T, z, y)
    cost = np.float32(0)
    for m in range(len(p)):
        re, im = gain * y[m].real, gain * y[m].imag
        size = np.sqrt(re * re + im * im)
        missed = size - p[m]
        cost += missed * missed
        part = gain * missed / max(size, np.float32(1e-30))
        y[m] = complex(part * re, -part * im)
    np.dot(out, y, g)
    np.dot(drive.T, z, q)
    loud = np.float32(0)
    for n in range(len(q)):
        re, im = q[n].real, q[n].imag
        above = max(re * re + im * im - np.float32(1), np.float32(0))
        loud += above * above
        q[n] = complex(weight * above * re, -weight * above * im)
    np.dot(drive, q, conjugate)
    for k in range(len(g)):
        total = g[k] + conjugate[k]
        g[k] = complex(total.real, -total.imag)
    return np.float32(0.5) * cost + np.float32(0.25) * weight * loud


@njit(cache=True, fastmath=True)
def descend(z, p, gain, out, drive, weight, step, iterations, work):
    """L-BFGS on one row; z (mode,) is moved in place. `work` is what `workspace` made."""
    y, q, conjugate, g, trial, slope, S, Y, rho, direction = work
    x, gx, tx, sx = z.view(np.float32), g.view(np.float32), trial.view(np.float32), slope.view(np.float32)
    memory, kept, scale, length = len(rho), 0, step, np.float32(1)
    cost = cost_and_slope(z, p, gain, out, drive, weight, y, q, conjugate, g)
    for _ in range(iterations):
        _two_loops(gx, S, Y, rho, kept, scale, direction)
        fall = np.float32(0)
        for i in range(len(x)):
            tx[i] = x[i] + length * direction[i]
            fall += direction[i] * gx[i]
        new = cost_and_slope(trial, p, gain, out, drive, weight, y, q, conjugate, slope)
        row = kept % memory
        sy, yy = np.float32(0), np.float32(0)
        for i in range(len(x)):
            S[row, i], Y[row, i] = tx[i] - x[i], sx[i] - gx[i]
            sy += S[row, i] * Y[row, i]
            yy += Y[row, i] * Y[row, i]
        if sy > np.float32(1e-10) * yy:
            rho[row], scale, kept = 1 / sy, sy / yy, kept + 1
        if new <= cost + np.float32(1e-4) * length * fall + np.float32(5e-7) * cost:
            cost, length = new, min(np.float32(1), 3 * length)
            x[:] = tx
            gx[:] = sx
        else:
            length *= np.float32(0.3)


@njit(cache=True, fastmath=True)
def _two_loops(gx, S, Y, rho, kept, scale, direction):
    """Nocedal & Wright, algorithm 7.4, on the last pairs of a ring."""
    memory = len(rho)
    weights = np.empty(8, np.float32)
    direction[:] = -gx
    last = max(kept - memory, 0)
    for j in range(kept - 1, last - 1, -1):
        row = j % memory
        weight = rho[row] * np.dot(S[row], direction)
        weights[row] = weight
        for i in range(len(direction)):
            direction[i] -= weight * Y[row, i]
    direction *= scale
    for j in range(last, kept):
        row = j % memory
        weight = weights[row] - rho[row] * np.dot(Y[row], direction)
        for i in range(len(direction)):
            direction[i] += weight * S[row, i]


@njit(cache=True, fastmath=True)
def lift(q, a, V, relaxation, iterations, error, change):
    """Alternating projections: q (transducer,) of magnitude 1 is moved in place until V^H q is close to a (mode,).

    V is (mode, transducer), transposed; error (mode,) and change (transducer,) are workspace.
    """
    for _ in range(iterations):
        for n in range(len(q)):
            change[n] = complex(q[n].real, -q[n].imag)
        np.dot(V, change, error)
        for k in range(len(a)):
            error[k] = complex(a[k].real - error[k].real, a[k].imag + error[k].imag)
        np.dot(V.T, error, change)
        for n in range(len(q)):
            re = q[n].real + relaxation * change[n].real
            im = q[n].imag + relaxation * change[n].imag
            part = 1 / np.sqrt(max(re * re + im * im, np.float32(1e-30)))
            q[n] = complex(part * re, part * im)


def workspace(points: int, some: int, rank: int, memory: int) -> tuple[np.ndarray, ...]:
    """The arrays that `descend` writes to."""
    kind, real = np.complex64, np.float32
    return (
        np.zeros(points, kind),
        np.zeros(some, kind),
        np.zeros(rank, kind),
        np.zeros(rank, kind),
        np.zeros(rank, kind),
        np.zeros(rank, kind),
        np.zeros((memory, 2 * rank), real),
        np.zeros((memory, 2 * rank), real),
        np.zeros(memory, real),
        np.zeros(2 * rank, real),
    )
