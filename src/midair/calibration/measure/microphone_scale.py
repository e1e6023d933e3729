"""How many pascals one of a file's numbers means, from a take of something known: a tone, or a weight that drops.

A sound file of a microphone says parts of its full scale and no pressure. Two things that a kitchen or a laboratory has
tell it: a tone of known level on the microphone, such as a calibrator's 94 dB (1.00 Pa rms, IEC 60942); and a small
weight that falls on the skin over it. A weight m from a height h arrives with the momentum m sqrt(2 g h); if it does
not bounce, the force's integral over the blow is that, and the pressure's the same over the area that it hits. Air is
neglected, and so is what bounces: a weight that rebounds gives up to twice as much.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.validation import positive

Array = NDArray[np.float64]

GRAVITY = 9.81
"""In m/s2."""

SILENT = 20e-6
"""Pressure of 0 dB, in Pa rms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MicrophoneScale:
    """What was found.

    Attributes
    ----------
    scale : float
        Pressure that 1 of the file's numbers means, in Pa.
    words : str
        From what, in one sentence.
    """

    scale: float
    words: str


def scale_of_tone(samples: Array, rate: float, *, level: float = 94.0) -> MicrophoneScale:
    """The scale by a tone of known level.

    Parameters
    ----------
    samples : ndarray, shape (frame,)
        The take of the tone, in the file's numbers.
    rate : float
        In Hz.
    level : float
        Of the tone, in dB re 20 uPa.

    Raises
    ------
    InputError
        If less than nine tenths of the power lie in one tone.
    """
    window = np.hanning(len(samples))
    power = np.abs(np.fft.rfft((samples - samples.mean()) * window)) ** 2
    peak = int(power[1:].argmax()) + 1 if len(power) > 1 else 0
    share = float(power[max(0, peak - 3) : peak + 4].sum() / (power.sum() or 1.0))
    if share < 0.9:
        raise InputError(
            f"reference: expected a tone, nine tenths of the power at one frequency, got {100 * share:.0f} % there; "
            "cut the take to where it sounds, and record it without clipping"
        )
    # Power of the tone alone: by Parseval, with what the window takes.
    rms = float(np.sqrt(2 * power[max(0, peak - 3) : peak + 4].sum() / (len(samples) * (window**2).sum())))
    pressure = SILENT * 10 ** (level / 20)
    at = peak * rate / len(samples)
    return MicrophoneScale(
        scale=pressure / rms,
        words=f"A tone of {at:.4g} Hz at {level:g} dB ({pressure:.3g} Pa rms) has {rms:.3g} rms in the reference: 1 "
        f"means {pressure / rms:.4g} Pa.",
    )


def scale_of_drop(samples: Array, rate: float, *, mass: float, height: float, diameter: float) -> MicrophoneScale:
    """The scale by a weight that drops on the skin over the microphone and stays there.

    Parameters
    ----------
    samples : ndarray, shape (frame,)
        The take of one blow, in the file's numbers.
    rate : float
        In Hz; the blow should last ten frames or more.
    mass, height, diameter : float
        Of the weight, in kg; of its fall, in m; of the round area that it hits, in m.

    Raises
    ------
    InputError
        If there is no blow that stands out, or it is shorter than four frames.
    """
    for value, name, unit in ((mass, "mass", "kg"), (height, "height", "m"), (diameter, "diameter", "m")):
        positive(value, f"{name} of the drop", unit)
    change = samples - np.median(samples)
    change = change if change.max() >= -change.min() else -change
    peak = int(change.argmax())
    noise = float(np.median(np.abs(change)))
    below = np.flatnonzero(change <= 0)
    first = int(below[below < peak].max(initial=-1)) + 1
    last = int(below[below > peak].min(initial=len(change)))
    if change[peak] < 20 * noise or change[peak] <= 0:
        raise InputError("reference: expected one blow that stands out twenty times over the noise, got none")
    if last - first < 4:
        raise InputError(
            f"reference: expected a blow of 4 frames or more, got {last - first}; record faster, or on softer skin"
        )
    area = np.pi * diameter**2 / 4
    impulse = mass * np.sqrt(2 * GRAVITY * height) / area
    scale = impulse / (float(change[first:last].sum()) / rate)
    return MicrophoneScale(
        scale=scale,
        words=f"{1e3 * mass:.3g} g from {1e3 * height:.3g} mm on {1e3 * diameter:.3g} mm bring {impulse:.3g} Pa s in "
        f"{1e3 * (last - first) / rate:.2g} ms: 1 means {scale:.4g} Pa, half as much if it bounced right back.",
    )
