"""Compute the played phases and their errors on the device that solved them.

On the host this takes longer than a GPU needs to solve.
"""

import numpy as np
from numpy.typing import NDArray

from midair.solvers.backend import Backend, Rows
from midair.solvers.problem import Array, Problem, error_of_field


def phases_and_errors(
    backend: Backend, problem: Problem, phase: Array, level: Array | None, bits: int | None
) -> tuple[Array, Array]:
    """Phases as they are played, 0 to 2 pi (frame, transducer), and their errors (frame,) as by `problem.error_of`.

    `there` must be in double precision. `phase` is in rad; `level`, (frame,) or (frame, transducer), is a factor on the
    problem's level; `bits` rounds phases to 2 pi / 2^bits as `physics.quantise_phase` does.
    """
    G, played, size = backend.put(problem.level * problem.G.T), np.empty_like(phase), np.empty(problem.amplitude.shape)
    with backend.at_work():
        for first in range(0, len(phase), backend.rows):
            here = slice(first, first + backend.rows)
            theta = _turned(backend, backend.put(phase[here]), bits)
            q = backend.phasor(theta)
            if level is not None:
                q = backend.put(_column(level[here])) * q
            played[here], size[here] = backend.get(theta), backend.get(backend.xp.abs(q @ G))
    return played, error_of_field(problem, size)


def _turned(backend: Backend, theta: Rows, bits: int | None) -> Rows:
    """Phases within 0 to 2 pi, rounded to the firmware's steps if `bits` is given."""
    xp, turn = backend.xp, 2 * np.pi
    if bits is None:
        return xp.remainder(theta, turn)
    steps = 2**bits
    return xp.remainder(xp.round(theta / turn * steps), float(steps)) * (turn / steps)


def _column(level: NDArray[np.float64]) -> NDArray[np.float64]:
    """The level with shape (frame, 1) or (frame, transducer)."""
    return level if level.ndim == 2 else level[:, None]
