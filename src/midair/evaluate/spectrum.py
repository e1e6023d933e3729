"""How two spectra differ, and where one is strongest."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def spectral_error(original: Array, later: Array) -> float:
    """How far two spectra are apart, in dB: the rms of their level difference, weighted by the original's power.

    Bins where the original has little weigh little, so that noise floors do not decide.

    Parameters
    ----------
    original, later : ndarray, shape (bin, ...)
        Power densities of the same bins.

    Returns
    -------
    float
        0 when equal; NaN never: an all-silent original gives 0 if the other is silent, too, and infinity if not.
    """
    total = original.sum()
    if total <= 0:
        return 0.0 if later.sum() <= 0 else float("inf")
    # 120 dB below the strongest bin stand in for silence, which has no level.
    tiny = 1e-12 * original.max()
    difference = 10 * np.log10((later + tiny) / (original + tiny))
    return float(np.sqrt((original * difference**2).sum() / total))


def power_spectrum(samples: Array) -> Array:
    """Power of the whole-length spectrum of samples (frame, ...) without their mean, shape (bin, ...)."""
    return np.asarray(np.abs(np.fft.rfft(samples - samples.mean(axis=0), axis=0)) ** 2, np.float64)


def strongest(power: Array, frames: int, rate: float) -> float:
    """Frequency of the strongest bin, in Hz, of a power spectrum (bin,) of so many frames."""
    return float(np.fft.rfftfreq(frames, 1 / rate)[int(np.argmax(power))])


def dominant_frequency(samples: Array, rate: float) -> float:
    """Frequency of the strongest bin of the whole-length spectrum without its mean, summed over channels, in Hz."""
    power = power_spectrum(samples)
    return strongest(power.reshape(len(power), -1).sum(axis=1), len(samples), rate)
