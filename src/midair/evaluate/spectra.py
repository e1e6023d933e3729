"""Spectra of vibrations: levels, their difference, and the dominant frequency."""

import numpy as np

from midair.array_types import Array


def level(power: Array, reference: Array | float = 1.0) -> Array:
    """10 log10(power / reference) in dB, same shape: infinite or NaN for silence."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(10 * np.log10(power / reference), np.float64)


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


def dominant_frequency(samples: Array, rate: float) -> float:
    """Frequency in Hz of the strongest Fourier component of samples (frame, ...), all channels together."""
    power = np.zeros(len(samples) // 2 + 1)
    for channel in samples.reshape(len(samples), -1).T:
        power += np.abs(np.fft.rfft(channel - channel.mean())) ** 2
    return float(np.fft.rfftfreq(len(samples), 1 / rate)[int(np.argmax(power))])
