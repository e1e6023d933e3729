"""Phases that hold at several temperatures: the points once more for each speed of sound.

Warmer air makes the wave longer, and a field that was made of waves of another length comes apart. Amplitudes alone are
wanted, so that each temperature has phases of its own at the points: the transfer matrices below each other are one
problem of as many times the points, which every method solves as it is, and whose error is the root mean square of E
over the temperatures.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.model import Acoustics

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def airs_around(acoustics: Acoustics, robust: float, *, apart: float = 2.0) -> tuple[Acoustics, ...]:
    """The air itself, then others from `robust` degrees colder to as much warmer, no further than `apart` from another.

    Two degrees turn the waves from the near and the far side of an array by a quarter of a radian against each other,
    little enough that what holds at both ends holds between them.

    Parameters
    ----------
    acoustics : Acoustics
        In the middle.
    robust : float
        In degrees Celsius; 0 for the air itself alone.

    Raises
    ------
    InputError
        If an end of the range is outside of what the formulas of air hold for.
    """
    steps = int(np.ceil(robust / apart))
    others = [robust * step / steps for step in range(-steps, steps + 1) if step]
    warmer = [replace(acoustics, medium=acoustics.medium.warmer(by)) for by in others]
    return (acoustics, *warmer)


def psi_in_each(G: list[Complex], psi: Array) -> Array:
    """First phases of the fields, (temperature times point,), in rad, that one drive makes: the first one's are `psi`.

    Fields that start out of step would ask opposite things of the transducers.

    Parameters
    ----------
    G : list of ndarray of complex, shape (point, transducer)
        One a temperature.
    psi : ndarray, shape (point,)
        Of the first, in rad.
    """
    back = np.exp(1j * psi) @ G[0].conj()
    drive = np.exp(1j * np.angle(back))
    return np.concatenate([psi, *(np.angle(each @ drive) for each in G[1:])])
