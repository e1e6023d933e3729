"""Inner loops of the live solver, compiled by Numba, with fixed work and no allocation.

Import this module late: Numba takes a second to load, and the first call compiles (cached on disk).
"""

# pyright: basic

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True, nogil=True)
def mirror(x, y):
    """Write into y (kind, place) the even and odd parts of x (image, place) under the mirrors; its own inverse.

    Kinds and images are those of `SymmetricModes`; with one image y is a copy.
    """
    X, Y = x.view(np.float32), y.view(np.float32)
    if len(x) == 1:
        # A loop: Numba takes ten seconds more to compile `Y[:] = X`, in each function that calls this one.
        for n in range(X.shape[1]):
            Y[0, n] = X[0, n]
        return
    half = np.float32(0.5)
    for n in range(X.shape[1]):
        a, b, c, d = X[0, n], X[1, n], X[2, n], X[3, n]
        Y[0, n] = half * ((a + b) + (c + d))
        Y[1, n] = half * ((a - b) + (c - d))
        Y[2, n] = half * ((a + b) - (c + d))
        Y[3, n] = half * ((a - b) - (c - d))


@njit(cache=True, fastmath=True, nogil=True)
def cost_and_slope(z, p, gain, out, drive, weight, y, q, kinds, conjugate, g):
    """Write the gradient by z into g and return the cost; see `field_operators`.

    z, g (mode,), kind after kind; p (point,) of norm 1; out (mode, point); drive (kind, mode of the kind, sampled
    place); y (point,), q (image, sampled place), kinds and conjugate are workspace; gain is the original norm of p: the
    drive is gain times that of z. All single precision.
    """
    np.dot(out.T, z, y)
    cost = np.float32(0)
    for m in range(len(p)):
        re, im = y[m].real, y[m].imag
        size = np.sqrt(re * re + im * im)
        missed = size - p[m]
        cost += missed * missed
        # The direction at a silent point is undefined; the limit is needed since fastmath does not support NaN.
        part = missed / max(size, np.float32(1e-30))
        # Conjugated, so that the product with `out` as it lies in memory is that with its adjoint.
        y[m] = complex(part * re, -part * im)
    np.dot(out, y, g)
    each = drive.shape[1]
    for kind in range(len(drive)):
        np.dot(drive[kind].T, z[kind * each : (kind + 1) * each], kinds[kind])
    mirror(kinds, q)
    loud, scale = np.float32(0), gain * weight
    for image in range(len(q)):
        for n in range(q.shape[1]):
            re, im = gain * q[image, n].real, gain * q[image, n].imag
            above = max(re * re + im * im - np.float32(1), np.float32(0))
            loud += above * above
            q[image, n] = complex(scale * above * re, -scale * above * im)
    mirror(q, kinds)
    for kind in range(len(drive)):
        np.dot(drive[kind], kinds[kind], conjugate[kind * each : (kind + 1) * each])
    for k in range(len(g)):
        total = g[k] + conjugate[k]
        g[k] = complex(total.real, -total.imag)
    return np.float32(0.5) * cost + np.float32(0.25) * weight * loud


@njit(cache=True, fastmath=True, nogil=True)
def bend(z, p, before, out, lens, towards, weak, y, g):
    """Move z (mode,), the field of the previous frame, in place to the start for the new target p (point,).

    The component of p along the previous target `before` keeps its field; the remainder is added with the phases of the
    field, or those of `lens` (exp j psi) where it is nearly silent. `before` becomes p; weak (mode,) damps weak modes;
    y (point,) and g (mode,) are workspace.
    """
    common, square, peak = np.float32(0), np.float32(0), np.float32(0)
    for m in range(len(p)):
        common += p[m] * before[m]
        square += before[m] * before[m]
        peak = max(peak, before[m])
    part = common / max(square, np.float32(1e-30))
    np.dot(out.T, z, y)
    for m in range(len(p)):
        re, im = y[m].real, y[m].imag
        loud = before[m] / max(np.sqrt(re * re + im * im), np.float32(1e-30))
        re = loud * re + towards * peak * lens[m].real
        im = loud * im + towards * peak * lens[m].imag
        new = (p[m] - part * before[m]) / max(np.sqrt(re * re + im * im), np.float32(1e-30))
        # Conjugated, so that the product with `out` as it lies in memory is that with its adjoint.
        y[m] = complex(new * re, -new * im)
        before[m] = p[m]
    np.dot(out, y, g)
    for k in range(len(z)):
        z[k] = complex(part * z[k].real + weak[k] * g[k].real, part * z[k].imag - weak[k] * g[k].imag)


@njit(cache=True, fastmath=True, nogil=True)
def descend(z, p, gain, out, drive, weight, iterations, pairs, work):
    """L-BFGS on one row; z (mode,) is changed in place.

    `pairs` and `work` come from `workspace`. The pairs stay for the next frame, whose cost has a similar curvature.
    """
    S, Y, rho, held, count, scale = pairs
    y, q, kinds, conjugate, g, trial, slope, direction = work
    x, gx, tx, sx = z.view(np.float32), g.view(np.float32), trial.view(np.float32), slope.view(np.float32)
    memory, length = len(rho), np.float32(1)
    cost = cost_and_slope(z, p, gain, out, drive, weight, y, q, kinds, conjugate, g)
    for _ in range(iterations):
        _two_loops(gx, S, Y, rho, held, count[0], scale[0], direction)
        fall = np.dot(direction, gx)
        # Pairs of earlier frames may give an uphill direction: then use the gradient alone.
        if not fall < 0:
            count[0] = 0
            for i in range(len(x)):
                direction[i] = -scale[0] * gx[i]
            fall = np.dot(direction, gx)
        for i in range(len(x)):
            tx[i] = x[i] + length * direction[i]
        new = cost_and_slope(trial, p, gain, out, drive, weight, y, q, kinds, conjugate, slope)
        row = count[0] % memory
        sy, yy = np.float32(0), np.float32(0)
        for i in range(len(x)):
            S[row, i], Y[row, i] = tx[i] - x[i], sx[i] - gx[i]
            sy += S[row, i] * Y[row, i]
            yy += Y[row, i] * Y[row, i]
        if yy > 0 and sy > np.float32(1e-10) * yy:
            rho[row], scale[0] = 1 / sy, sy / yy
            count[0] += 1
        # A rise below 5e-7 of the cost, four rounding errors, is accepted.
        if new <= cost + np.float32(1e-4) * length * fall + np.float32(5e-7) * cost:
            cost, length = new, min(np.float32(1), 3 * length)
            for i in range(len(x)):
                x[i], gx[i] = tx[i], sx[i]
        else:
            length *= np.float32(0.3)


@njit(cache=True, fastmath=True, nogil=True)
def _two_loops(gx, S, Y, rho, held, count, scale, direction):
    """Two-loop recursion, Nocedal & Wright, algorithm 7.4, on the last pairs of a ring buffer."""
    memory = len(rho)
    for i in range(len(gx)):
        direction[i] = -gx[i]
    last = max(count - memory, 0)
    for j in range(count - 1, last - 1, -1):
        row = j % memory
        weight = rho[row] * np.dot(S[row], direction)
        held[row] = weight
        for i in range(len(direction)):
            direction[i] -= weight * Y[row, i]
    for i in range(len(direction)):
        direction[i] *= scale
    for j in range(last, count):
        row = j % memory
        weight = held[row] - rho[row] * np.dot(Y[row], direction)
        for i in range(len(direction)):
            direction[i] += weight * S[row, i]


@njit(cache=True, fastmath=True, nogil=True)
def lift(q, z, gain, root, V, step, momentum, iterations, error, change, kinds, speed):
    """Heavy ball on the phases of q (image, place), in place, until V^H q is close to gain z / root (mode,).

    || V^H q - a ||^2 / 2 decreases with the phases at the rate Im(conj(q) V (a - V^H q)). V is (kind, mode of the kind,
    place), transposed; error (mode,), change, kinds and speed (image, place) are workspace. Places without a transducer
    have q = 0, which stays 0.
    """
    each = V.shape[1]
    for image in range(len(q)):
        for n in range(q.shape[1]):
            speed[image, n] = 0
            change[image, n] = complex(q[image, n].real, -q[image, n].imag)
    for _ in range(iterations):
        mirror(change, kinds)
        for kind in range(len(V)):
            np.dot(V[kind], kinds[kind], error[kind * each : (kind + 1) * each])
        for k in range(len(z)):
            wanted = gain / root[k]
            error[k] = complex(wanted * z[k].real - error[k].real, wanted * z[k].imag + error[k].imag)
        for kind in range(len(V)):
            np.dot(V[kind].T, error[kind * each : (kind + 1) * each], kinds[kind])
        mirror(kinds, change)
        for image in range(len(q)):
            for n in range(q.shape[1]):
                uphill = q[image, n].real * change[image, n].imag - q[image, n].imag * change[image, n].real
                speed[image, n] = momentum * speed[image, n] + step * uphill
                # (1 + j t) / |1 + j t| rotates by arctan t, which is close to t and below a quarter turn.
                re = q[image, n].real - speed[image, n] * q[image, n].imag
                im = q[image, n].imag + speed[image, n] * q[image, n].real
                part = 1 / np.sqrt(max(re * re + im * im, np.float32(1e-30)))
                q[image, n] = complex(part * re, part * im)
                change[image, n] = complex(part * re, -part * im)


@njit(cache=True, fastmath=True, nogil=True)
def follow(bends, bending, moving, lifting, field, lifts):
    """Call `bend` if wanted, `descend` and `lift` in one compiled call.

    Each return to Python waits for the interpreter lock, which the thread that reads the sensor may hold.
    """
    if bends:
        z, p, before, out, lens, towards, weak, y, g = bending
        bend(z, p, before, out, lens, towards, weak, y, g)
    z, p, gain, out, drive, weight, pairs, work = moving
    descend(z, p, gain, out, drive, weight, field, pairs, work)
    q, root, V, step, momentum, error, change, kinds, speed = lifting
    lift(q, z, gain, root, V, step, momentum, lifts, error, change, kinds, speed)


def workspace(points: int, some: tuple[int, int], rank: int, memory: int, scale: float):
    """The pairs and work arrays of `descend`; `scale` is the initial guess of the inverse Hessian."""
    kind, real = np.complex64, np.float32
    pairs = (
        np.zeros((memory, 2 * rank), real),
        np.zeros((memory, 2 * rank), real),
        np.zeros(memory, real),
        np.zeros(memory, real),
        np.zeros(1, np.int64),
        np.full(1, scale, real),
    )
    lengths = (points, some, some, rank, rank, rank, rank)
    return pairs, (*(np.zeros(length, kind) for length in lengths), np.zeros(2 * rank, real))
