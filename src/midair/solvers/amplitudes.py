"""Amplitudes between 0 and full, by solvers that know only full ones.

Any drive no louder than full is the mean of two drives at full: a exp(j theta) = (exp(j alpha) + exp(j beta)) / 2 with
theta = (alpha + beta) / 2 and a = cos((alpha - beta) / 2). So bounded amplitudes 0 <= a <= 1 on N transducers are
equal amplitudes on 2N of half the strength, and every solver finds them as it is. (Holography calls it double phase:
Hsueh & Sawchuk, "Computer-generated double-phase holograms", Applied Optics 17 (1978).)
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.solvers.problem import Problem
from midair.solvers.terms import GuardField

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

Amplitudes = Literal["equal", "bounded"]
"""All transducers at the same drive, as in the paper; or each at its own, between 0 and that."""


def doubled(problem: Problem, *, apart: float = np.pi / 4) -> Problem:
    """The same problem for twice as many transducers of half the strength.

    `apart` is half the angle, in rad, between the two of a pair when both unknowns are 0: a solver that starts there
    must not find the two alike, since alike they would stay.
    """
    guard = problem.guard
    if guard is not None:
        guard = GuardField(G=_twice(guard.G, apart), ceiling=guard.ceiling, weight=guard.weight)
    position = None if problem.position is None else np.tile(problem.position, (2, 1))
    return replace(problem, G=_twice(problem.G, apart), guard=guard, position=position)


def halves(phase: Array, *, apart: float = np.pi / 4) -> tuple[Array, Array]:
    """Phase and amplitude of the N transducers for phases of the 2N.

    Parameters
    ----------
    phase : ndarray, shape (frame, 2 transducer)
        Phases of a solution of the doubled problem, in rad.
    apart : float
        As it was doubled with.

    Returns
    -------
    theta : ndarray, shape (frame, transducer)
        In rad.
    amplitude : ndarray, shape (frame, transducer)
        0 to 1.
    """
    count = phase.shape[1] // 2
    q = (np.exp(1j * (phase[:, :count] + apart)) + np.exp(1j * (phase[:, count:] - apart))) / 2
    # Rounding can leave a hair above full drive, which a drive refuses.
    return np.angle(q), np.minimum(np.abs(q), 1.0)


def _twice(G: Complex, apart: float) -> Complex:
    # Halved, so that a pair in step is as loud as the one transducer that it stands for.
    return np.asarray(np.concatenate([np.exp(1j * apart) * G, np.exp(-1j * apart) * G], axis=1) / 2, np.complex128)
