"""L-BFGS for one function of many variables (Nocedal & Wright, "Numerical Optimization", 2nd edition, algorithm 7.4).

One evaluation per step: a step that fails the Armijo test is rejected, and a shorter one is tried next.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Single = NDArray[np.float32]
Function = Callable[[Single], tuple[float, Single]]
"""x -> cost and gradient."""


def descend(
    function: Function, x: Single, *, scale: Single, first: float, iterations: int, memory: int, shrink: float = 0.3
) -> Single:
    """The x with the least cost after this number of evaluations, besides two.

    `scale`, of a shape that broadcasts to `x`, is the relative inverse curvature of each variable; its unit is
    determined by a first step of root mean square `first`. `memory` is the number of pairs kept, `shrink` the factor on
    the step length after a rejection.
    """
    cost, gradient = function(x)
    step = scale * gradient
    size = float(np.sqrt(np.mean(step**2)))
    if not size > 0:
        return x
    pairs: list[tuple[Single, Single]] = []
    probe = np.asarray(-(first / size) * step, np.float32)
    _remember(pairs, probe, function(x + probe)[1] - gradient, memory)
    length = 1.0
    for _ in range(iterations):
        direction = _direction(pairs, gradient, scale)
        moved = np.asarray(length * direction, np.float32)
        trial, slope = function(x + moved)
        better = trial <= cost + 1e-4 * float(np.vdot(moved, gradient))
        _remember(pairs, moved, slope - gradient, memory)
        if better:
            x, cost, gradient, length = x + moved, trial, slope, 1.0
        else:
            length *= shrink
    return x


def _remember(pairs: list[tuple[Single, Single]], step: Single, change: Single, memory: int) -> None:
    """Keep a pair unless its curvature is not positive, which could make later directions uphill."""
    if float(np.vdot(step, change)) > 1e-10 * float(np.vdot(change, change)):
        pairs.append((step, change))
        del pairs[:-memory]


def _direction(pairs: list[tuple[Single, Single]], gradient: Single, scale: Single) -> Single:
    """Two-loop recursion: minus the approximate inverse Hessian times the gradient."""
    d, parts = -gradient, list[float]()
    for step, change in reversed(pairs):
        parts.append(float(np.vdot(step, d) / np.vdot(step, change)))
        d = d - np.float32(parts[-1]) * change
    d = scale * d
    if pairs:
        step, change = pairs[-1]
        d *= np.float32(np.vdot(step, change) / np.vdot(change, scale * change))
    for (step, change), part in zip(pairs, reversed(parts), strict=True):
        d += np.float32(part - float(np.vdot(change, d) / np.vdot(step, change))) * step
    return d
