"""Bounded amplitudes from solvers that support only equal ones.

Any drive of at most full amplitude is the mean of two drives at full amplitude: a exp(j theta) = (exp(j alpha) + exp(j
beta)) / 2 with theta = (alpha + beta) / 2 and a = cos((alpha - beta) / 2). So amplitudes 0 <= a <= 1 on N transducers
are equal amplitudes on 2N transducers of half the strength, which every solver supports. In holography: double phase
(Hsueh & Sawchuk, "Computer-generated double-phase holograms", Applied Optics 17 (1978)).
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.solvers.problem import Answer, GuardField, Problem

Complex = NDArray[np.complex128]

Amplitudes = Literal["equal", "bounded"]
"""All transducers at the same drive, as in the paper; or each at its own, between 0 and that drive."""


def doubled(problem: Problem, *, apart: float = np.pi / 4) -> Problem:
    """The same problem for twice as many transducers of half the strength.

    `apart` is half the angle, in rad, between the two phases of a pair when both unknowns are 0: a solver that starts
    with equal phases would keep them equal.
    """
    guard = problem.guard
    if guard is not None:
        guard = GuardField(G=_twice(guard.G, apart), ceiling=guard.ceiling, weight=guard.weight)
    position = None if problem.position is None else np.tile(problem.position, (2, 1))
    return replace(problem, G=_twice(problem.G, apart), guard=guard, position=position)


def with_amplitudes(answer: Answer) -> Answer:
    """The answer of a doubled problem as phases of the array, and the amplitude of each transducer."""
    phase, part = halves(answer.phase)
    return replace(answer, phase=phase, level=part if answer.level is None else answer.level[:, None] * part)


def halves(phase: Array, *, apart: float = np.pi / 4) -> tuple[Array, Array]:
    """Phase (rad) and amplitude (0 to 1), (frame, transducer), from phases (frame, 2 transducer) of the doubled
    problem.
    """
    count = phase.shape[1] // 2
    q = (np.exp(1j * (phase[:, :count] + apart)) + np.exp(1j * (phase[:, count:] - apart))) / 2
    # Rounding can give slightly more than full drive, which `Drive` rejects.
    return np.angle(q), np.minimum(np.abs(q), 1.0)


def _twice(G: Complex, apart: float) -> Complex:
    # Halved, so that a pair in phase has the amplitude of the transducer that it represents.
    return np.asarray(np.concatenate([np.exp(1j * apart) * G, np.exp(-1j * apart) * G], axis=1) / 2, np.complex128)
