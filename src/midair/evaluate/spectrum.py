"""How two spectra differ, and where one is strongest."""

import numpy as np
from numpy.typing import NDArray

from midair.lazy_frames import LazyFrames, read_frames

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


LONGEST = 2**17
"""Frames of which a spectrum is taken at once: 131 s at 1 kHz, 33 s at 4 kHz."""


def long_stretches(frames: int) -> list[tuple[int, int]]:
    """(first, last) of as few stretches of one length as there are with `LONGEST` frames each at most.

    A few frames at the end are left out where their number does not divide by that of the stretches.
    """
    count = -(-frames // LONGEST)
    return [(number * (frames // count), (number + 1) * (frames // count)) for number in range(count)]


def power_spectrum(samples: Array | LazyFrames) -> tuple[Array, int]:
    """Power of the spectrum of samples (frame, ...) without their means, summed over channels, and its frames.

    Of more than `LONGEST` frames it is the sum over stretches.

    Returns
    -------
    power : ndarray, shape (bin,)
    frames : int
        Of which each spectrum is.
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
