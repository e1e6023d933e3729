"""Phases that hold at several temperatures: the control points once more for each speed of sound.

The wavelength grows with temperature, and a field made for another wavelength loses its shape. Only amplitudes matter,
so each temperature has its own phases at the points: the stacked transfer matrices are one problem with that many times
the points, which every method can solve, and whose error is the root mean square of E over the temperatures.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics

Complex = NDArray[np.complex128]


def airs_around(acoustics: Acoustics, robust: float, *, apart: float = 2.0) -> tuple[Acoustics, ...]:
    """The air itself, then others up to `robust` degrees Celsius colder and warmer, in steps of at most `apart`.

    Two degrees shift waves from the near and the far side of an array by a quarter of a radian against each other, so a
    solution for both holds in between. Raises InputError outside the range of the formulas for air.
    """
    steps = int(np.ceil(robust / apart))
    others = [robust * step / steps for step in range(-steps, steps + 1) if step]
    warmer = [replace(acoustics, medium=acoustics.medium.warmer(by)) for by in others]
    return (acoustics, *warmer)


def psi_at_temperatures(G: list[Complex], psi: Array) -> Array:
    """Initial phases of the field at each temperature, (temperature times point,) in rad; `psi` (point,) is the first.

    They belong to one drive, since phases of different drives would contradict each other.
    """
    back = np.exp(1j * psi) @ G[0].conj()
    drive = np.exp(1j * np.angle(back))
    return np.concatenate([psi, *(np.angle(each @ drive) for each in G[1:])])
