"""Conversion of a drive to the firmware format of AUTD3: one byte of phase and one of intensity per transducer.

The firmware uses the same signs as midair, q = exp(+j phi) and G = exp(+j k d) / d, so that the byte is round(phi / 2
pi * 256) mod 256. An intensity byte I becomes a pulse of w = round(512 asin(I / 255) / pi) of 512 steps, with an
amplitude of sin(pi w / 512): I = round(255 level), accurate to .005 of full drive.
"""

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import RateError
from midair.model import Drive
from midair.streaming import each_frame

Bytes = NDArray[np.uint8]

TICK = 25_000
"""Period of the ultrasound in ns: every instant of the firmware is a multiple of it."""

PHASE_STEPS = 256
"""Number of phase steps per turn."""


def phase_bytes(drive: Drive, units: int) -> Bytes:
    """Phases in `PHASE_STEPS` per turn, shape (frame, unit, transducer of the unit); lazy if the drive is."""

    def in_steps(phase: Array) -> Bytes:
        steps = np.rint(phase * (PHASE_STEPS / (2 * np.pi)))
        # From int64 to bytes whole turns are lost, as by the modulo of 256, which takes three times as long.
        return steps.astype(np.int64).astype(np.uint8).reshape(len(phase), units, -1)

    return each_frame(drive.phase, in_steps)


def intensity_bytes(drive: Drive, units: int) -> Bytes:
    """Intensities, shape (frame,) if all transducers share one, else (frame, unit, transducer of the unit)."""

    def in_steps(level: Array) -> Bytes:
        steps = np.rint(level * 255).astype(np.uint8)
        return steps if steps.ndim == 1 else steps.reshape(len(steps), units, -1)

    return each_frame(drive.level, in_steps)


def amplitude_of(intensity: Bytes) -> NDArray[np.float64]:
    """Actual amplitude of an intensity byte relative to full drive, from its pulse width, same shape."""
    width = np.rint(512 / np.pi * np.arcsin(intensity / 255))
    return np.sin(np.pi * width / 512)


def actual_level(level: Array) -> Array:
    """Actual level after rounding to bytes and pulses, shape (frame,) or (frame, transducer).

    Half a step, .002 of full drive, is rounded to a whole step and then to a pulse of .006: 10 dB louder. If all
    transducers share a level, the level itself is returned where it is higher. Levels of single transducers are exact,
    since a drive can be silent at a place with the stated ones and loud with the actual ones.
    """
    played = amplitude_of(np.arange(256, dtype=np.uint8))[np.rint(level * 255).astype(np.uint8)]
    return np.asarray(np.maximum(np.abs(level), played) if level.ndim == 1 else played, np.float64)


def divider(rate: float) -> int:
    """Number N of ultrasound periods in a frame: rate = 40 kHz / N.

    Raises RateError if there is none from 1 to 65535.
    """
    exact = 40e3 / rate
    whole = round(exact)
    if not 1 <= whole <= 65535 or abs(exact - whole) > 1e-6 * exact:
        low, high = (40e3 / max(1, min(65535, number)) for number in (int(exact) + 1, int(exact)))
        raise RateError(
            f"drive: expected a rate of 40 kHz / N with N whole, 1 to 65535, got {rate:g} Hz; "
            f"solve it at {low:.6g} or {high:.6g} Hz"
        )
    return whole
