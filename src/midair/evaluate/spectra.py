"""Spectra of vibrations: levels, and the dominant frequency."""

import numpy as np

from midair.array_types import Array


def level(power: Array, reference: Array | float = 1.0) -> Array:
    """10 log10(power / reference) in dB, same shape: infinite or NaN for silence."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(10 * np.log10(power / reference), np.float64)


def dominant_frequency(samples: Array, rate: float) -> float:
    """Frequency in Hz of the strongest Fourier component of samples (frame, ...), all channels together."""
    power = np.zeros(len(samples) // 2 + 1)
    for channel in samples.reshape(len(samples), -1).T:
        power += np.abs(np.fft.rfft(channel - channel.mean())) ** 2
    return float(np.fft.rfftfreq(len(samples), 1 / rate)[int(np.argmax(power))])
