"""What a texture sounds like to skin, whatever its level: how its power is shared out over third octaves."""

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_energy
from midair.errors import InputError
from midair.model import PressureFrames

Array = NDArray[np.float64]

THIRD_OCTAVES = tuple(float(1000 * 10 ** (number / 10)) for number in range(-16, -3))
"""Middles of the third octaves that lie in 20 to 470 Hz as a whole, 25 to 398 Hz (base ten, IEC 61260-1)."""

_FLOOR = 1e-6  # of all power; what is less is noise of the arithmetic, and has no level


def third_octaves(pressure: PressureFrames) -> Array:
    """Level of each third octave of a pressure, over all cells, re the power of all of them together, in dB.

    Levels do not hear how loud the whole is, so that a texture and a weak copy of it are alike.

    Parameters
    ----------
    pressure : PressureFrames
        At 1 kHz or faster.

    Returns
    -------
    ndarray, shape (13,)
        -60 dB where there is next to nothing.

    Raises
    ------
    InputError
        If there is nothing in any band.
    BandError
        If the rate is too low for the last one.
    """
    half = 10**0.05
    power = np.array(
        [
            band_energy(pressure.pressure, pressure.rate, (middle / half, middle * half)).sum()
            for middle in THIRD_OCTAVES
        ]
    )
    if not power.sum() > 0:
        raise InputError("texture: expected something to feel in 22 to 447 Hz, got silence")
    return 10 * np.log10(np.maximum(power / power.sum(), _FLOOR))
