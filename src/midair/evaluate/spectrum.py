"""Difference between spectra, and dominant frequency."""

import numpy as np

from midair.array_types import Array
from midair.streaming import LazyFrames, read_frames


def spectral_error(original: Array, later: Array) -> float:
    """Rms level difference of two power densities (bin, ...) in dB, weighted by the power of the original.

    Bins with little power in the original have little weight, so that noise floors do not matter. The result is never
    NaN: for a silent original it is 0 if the other is silent too, otherwise infinite.
    """
    total = original.sum()
    if total <= 0:
        return 0.0 if later.sum() <= 0 else float("inf")
    # Silence has no level, so use 120 dB below the strongest bin instead.
    tiny = 1e-12 * original.max()
    difference = 10 * np.log10((later + tiny) / (original + tiny))
    return float(np.sqrt((original * difference**2).sum() / total))


LONGEST = 2**17
"""Frames per spectrum: 131 s at 1 kHz, 33 s at 4 kHz."""


def long_stretches(frames: int) -> list[tuple[int, int]]:
    """(first, last) frames of the fewest segments of equal length with at most `LONGEST` frames.

    A few frames at the end are omitted if the frames do not divide evenly.
    """
    count = -(-frames // LONGEST)
    return [(number * (frames // count), (number + 1) * (frames // count)) for number in range(count)]


def power_spectrum(samples: Array | LazyFrames) -> tuple[Array, int]:
    """Power spectrum of samples (frame, ...) without their means, summed over channels, and the frames per spectrum.

    The spectra of segments are summed for more than `LONGEST` frames.
    """
    parts = long_stretches(len(samples))
    frames = parts[0][1]
    power = np.zeros(frames // 2 + 1)
    for first, last in parts:
        for channel in read_frames(samples, first, last).reshape(frames, -1).T:
            power += np.abs(np.fft.rfft(channel - channel.mean())) ** 2
    return power, frames


def dominant_frequency(samples: Array | LazyFrames, rate: float) -> float:
    """Frequency of the strongest bin of `power_spectrum`, in Hz."""
    power, frames = power_spectrum(samples)
    return float(np.fft.rfftfreq(frames, 1 / rate)[int(np.argmax(power))])
