"""What is told of phases that were solved on a device: within a turn, rounded, and the field that they make, there.

On the host the turn and the product with the whole G took longer than a GPU needs for the phases.
"""

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Rows
from midair.solvers.problem import Array, Problem, error_of_field


def settled(
    there: Backend, problem: Problem, phase: Array, level: Array | None, bits: int | None
) -> tuple[Array, Array]:
    """Phases as they will be played, and their errors.

    Parameters
    ----------
    there : Backend
        In double precision.
    problem : Problem
        G, p and A.
    phase : ndarray, shape (frame, transducer)
        In rad, any multiple of 2 pi.
    level : ndarray, shape (frame,) or (frame, transducer), or None
        Part of the problem's level; all of it if None.
    bits : int or None
        Phases are rounded to 2 pi / 2^bits, as `physics.quantise_phase` does; not if None.

    Returns
    -------
    phase : ndarray, shape (frame, transducer)
        0 to 2 pi.
    error : ndarray, shape (frame,)
        As `problem.error_of` gives it.
    """
    G, played, size = there.put(problem.level * problem.G.T), np.empty_like(phase), np.empty(problem.amplitude.shape)
    with there.at_work():
        for first in range(0, len(phase), there.rows):
            here = slice(first, first + there.rows)
            theta = _turned(there, there.put(phase[here]), bits)
            q = there.phasor(theta)
            if level is not None:
                q = there.put(_column(level[here])) * q
            played[here], size[here] = there.get(theta), there.get(there.xp.abs(q @ G))
    return played, error_of_field(problem, size)


def _turned(there: Backend, theta: Rows, bits: int | None) -> Rows:
    """Within 0 to 2 pi, on the firmware's grid if there are bits."""
    xp, turn = there.xp, 2 * np.pi
    if bits is None:
        return xp.remainder(theta, turn)
    steps = 2**bits
    return xp.remainder(xp.round(theta / turn * steps), float(steps)) * (turn / steps)


def _column(level: NDArray[np.float64]) -> NDArray[np.float64]:
    """One number a frame, or one a transducer, by frames."""
    return level if level.ndim == 2 else level[:, None]
