"""Pressure for three kinds of tactile receptors, in place of the recorded waveform.

A focus that turns on a small orbit excites slowly adapting receptors (SA-I), a vibration of 30 Hz fast adapting ones
(FA-I), and one of 150 Hz Pacinian corpuscles (FA-II): Morisaki, Matsubayashi, Makino and Shinoda, arXiv 2601.16767,
2026. The orbit is a `Circle`. How a recording gives the three levels is not theirs, and not validated on people.
"""

import numpy as np
import scipy

from midair.array_types import Array
from midair.dsp import band_window, filter_response
from midair.errors import RateError

FAST, PACINIAN = 30.0, 150.0
"""Frequencies in Hz of the vibrations for fast adapting receptors and for Pacinian corpuscles."""
SPLITS = ((10.0, 10.0), (60.0, 20.0))
"""Limits between the bands of the three kinds, and widths of the transitions, in Hz."""
RISE = 0.15
"""Time in s before a touch in which the levels rise from less than half a percent."""
SMOOTH = 0.1
"""Length in s of the Hann window over which the level of a band is averaged: no ripple from 20 Hz on."""


def receptor_pressure(
    slow: Array | float, fast: Array | float, pacinian: Array | float, time: Array, high: float = PACINIAN
) -> Array:
    """P = slow + fast (1 + cos 2 pi 30 t) / 2 + pacinian (1 + cos 2 pi `high` t) / 2, at times in s.

    Its spectrum has the lines slow + fast / 2 + pacinian / 2 at 0 Hz, fast / 2 and pacinian / 2; its peak is the sum.
    """
    low, upper = ((1 + np.cos(2 * np.pi * frequency * time)) / 2 for frequency in (FAST, high))
    return slow + fast * low + pacinian * upper


def receptor_levels(pressure: Array, rate: float) -> tuple[Array, Array, Array]:
    """Pressure below 10 Hz, and amplitudes sqrt(2) rms of 10 to 60 Hz and of all above, same shape, in Pa."""
    shape = (-1, *[1] * (pressure.ndim - 1))

    def below(limit: float, width: float) -> Array:
        def window(frequency: Array) -> Array:
            return band_window(frequency, (0.0, limit), edges=(0.0, width)).reshape(shape)

        return filter_response(pressure, rate, window, reach=4 / width)

    hann = np.hanning(2 * round(SMOOTH * rate / 2) + 3)[1:-1]
    slow, most = (below(*split) for split in SPLITS)

    def amplitude(inside: Array, outside: Array) -> Array:
        power = scipy.ndimage.convolve1d((inside - outside) ** 2, hann / hann.sum(), axis=0, mode="nearest")
        return np.sqrt(2 * np.asarray(power, np.float64))

    return slow, amplitude(most, slow), amplitude(pressure, most)


def receptors(pressure: Array, rate: float) -> Array:
    """P = max(s, a + b) + a cos(2 pi 30 t) + b cos(2 pi 150 t), with s, a and b of `receptor_levels`; in Pa.

    The mean is the recorded one where the sensor measures it and it is large enough for the vibrations, the least that
    keeps P above zero otherwise. Raises RateError below 300 frames a second.
    """
    if rate < 2 * PACINIAN:
        raise RateError(f"mapping receptors: expected {2 * PACINIAN:g} frames a second or more, got {rate:g}")

    s, a, b = receptor_levels(pressure, rate)
    time = (np.arange(len(s)) / rate).reshape(-1, *[1] * (s.ndim - 1))
    return receptor_pressure(np.maximum(s - a - b, 0), 2 * a, 2 * b, time)
