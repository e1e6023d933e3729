"""Spectral shape of a texture in third octaves, independent of its level."""

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_energy
from midair.errors import InputError
from midair.model import PressureFrames

Array = NDArray[np.float64]

THIRD_OCTAVES = tuple(float(1000 * 10 ** (number / 10)) for number in range(-16, -3))
"""Centre frequencies of the third octaves completely within 20 to 470 Hz, 25 to 398 Hz (base ten, IEC 61260-1)."""

_FLOOR = 1e-6  # relative to the total power; anything below is rounding noise


def third_octaves(pressure: PressureFrames) -> Array:
    """Level of each third octave relative to the total power of all cells, in dB, shape (13,), at least -60 dB.

    The levels do not depend on the overall level, so a texture and a weaker copy of it have the same levels.

    Raises
    ------
    InputError
        If there is no power in any band.
    BandError
        If the rate is too low for the last band; 1 kHz is enough.
    """
    half = 10**0.05
    power = np.array(
        [
            band_energy(pressure.pressure, pressure.rate, (middle / half, middle * half)).sum()
            for middle in THIRD_OCTAVES
        ]
    )
    if not power.sum() > 0:
        raise InputError("texture: expected vibration between 22 and 447 Hz, got silence")
    return 10 * np.log10(np.maximum(power / power.sum(), _FLOOR))
