"""Scale of a microphone's sound file in Pa, from a tone of known level or from a falling weight."""

from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.validation import positive

GRAVITY = 9.81
"""In m/s2."""

SILENT = 20e-6
"""Reference pressure of 0 dB, in Pa rms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MicrophoneScale:
    """Scale of the samples of a microphone's sound file, which are relative to full scale, in Pa.

    Two simple references provide it: a tone of known level, such as a calibrator's 94 dB (1.00 Pa rms, IEC 60942), and
    a small weight that falls on the skin over the microphone. A weight m from a height h arrives with the momentum m
    sqrt(2 g h). If it does not bounce, this is the time integral of the force, and the pressure follows from the
    contact area. Air resistance and rebound are neglected: a weight that rebounds transfers up to twice the momentum.
    """

    scale: float
    """Pressure of a sample value of 1, in Pa."""
    words: str
    """Description of the measurement in one sentence."""


def scale_of_tone(samples: Array, rate: float, *, level: float = 94.0) -> MicrophoneScale:
    """Compute the scale from samples (frame,), in the file's units, of a tone of known `level` in dB re 20 uPa.

    Raises InputError if the tone has less than nine tenths of the power.
    """
    window = np.hanning(len(samples))
    power = np.abs(np.fft.rfft((samples - samples.mean()) * window)) ** 2
    peak = int(power[1:].argmax()) + 1 if len(power) > 1 else 0
    share = float(power[max(0, peak - 3) : peak + 4].sum() / (power.sum() or 1.0))
    if share < 0.9:
        raise InputError(
            f"reference: expected a tone with nine tenths of the power, got {100 * share:.0f} %; cut the recording to "
            "the tone, and record it without clipping"
        )
    # Power of the tone alone, by Parseval's theorem, corrected for the window.
    rms = float(np.sqrt(2 * power[max(0, peak - 3) : peak + 4].sum() / (len(samples) * (window**2).sum())))
    pressure = SILENT * 10 ** (level / 20)
    at = peak * rate / len(samples)
    return MicrophoneScale(
        scale=pressure / rms,
        words=f"A tone of {at:.4g} Hz at {level:g} dB ({pressure:.3g} Pa rms) has {rms:.3g} rms in the reference: 1 "
        f"means {pressure / rms:.4g} Pa.",
    )


def scale_of_drop(samples: Array, rate: float, *, mass: float, height: float, diameter: float) -> MicrophoneScale:
    """Compute the scale from a weight that drops on the skin over the microphone and stays there.

    `samples` (frame,), in the file's units, hold one impact, which should last ten frames or more. `mass` is in kg, the
    `height` of the fall and the `diameter` of the round contact area in m. Raises InputError if no impact stands out,
    or it is shorter than four frames.
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
        raise InputError("reference: expected one impact of at least twenty times the noise, got none")
    if last - first < 4:
        raise InputError(
            f"reference: expected an impact of 4 frames or more, got {last - first}; use a higher rate or softer skin"
        )
    area = np.pi * diameter**2 / 4
    impulse = mass * np.sqrt(2 * GRAVITY * height) / area
    scale = impulse / (float(change[first:last].sum()) / rate)
    return MicrophoneScale(
        scale=scale,
        words=f"{1e3 * mass:.3g} g from {1e3 * height:.3g} mm on {1e3 * diameter:.3g} mm bring {impulse:.3g} Pa s in "
        f"{1e3 * (last - first) / rate:.2g} ms: 1 means {scale:.4g} Pa, half as much if it bounced right back.",
    )
