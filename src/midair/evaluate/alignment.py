"""Bringing two recordings of the same thing to the same time."""

import numpy as np
from numpy.typing import NDArray

from midair.channels import channels
from midair.reel import Reel

Array = NDArray[np.float64]


def find_delay(original: Array | Reel, later: Array | Reel, rate: float, *, longest: float = 0.05) -> float:
    """How much later `later` is, from the peak of the cross-correlation summed over the channels.

    A parabola through the peak and its neighbours gives the part of a frame.

    Parameters
    ----------
    original, later : ndarray or Reel, shape (frame, ...)
        The same channels at the same rate.
    rate : float
        In Hz.
    longest : float
        Delays searched, to either side, in s.

    Returns
    -------
    float
        In s; 0 when either is silent.
    """
    frames = len(original)
    # With zeros after both, so that no delay that is looked at wraps round.
    length = frames + max(frames, len(later))
    both = np.zeros(length // 2 + 1, complex)
    for a, b in zip(channels(original), channels(later), strict=True):
        both += np.conj(np.fft.rfft(a, length)) * np.fft.rfft(b, length)
    correlation = np.fft.irfft(both, length)
    reach = max(1, min(round(longest * rate), max(frames, len(later)) - 1))
    around = np.roll(correlation, reach)[: 2 * reach + 1]
    best = int(np.argmax(around))
    # Nothing alike at any delay: moving one of them would be arbitrary.
    if around[best] <= 0:
        return 0.0
    if not 0 < best < 2 * reach:
        return (best - reach) / rate
    left, middle, right = around[best - 1 : best + 2]
    bend = left - 2 * middle + right
    # A peak bends downwards; a flat one has no part of a frame to tell.
    part = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return (best - reach + float(part)) / rate


def advance(samples: Array, delay: float, rate: float) -> Array:
    """`samples` earlier by `delay` seconds, by a linear phase on the spectrum with silence on both sides.

    Parameters
    ----------
    samples : ndarray, shape (frame, ...)
        Samples at `rate`.
    delay : float
        In s, of any sign, not necessarily whole frames.
    rate : float
        In Hz.

    Returns
    -------
    ndarray, same shape
    """
    frames = len(samples)
    length = 2 * frames
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(length, 1 / rate) * delay)
    spectrum = np.fft.rfft(samples, length, axis=0) * turn.reshape(-1, *[1] * (samples.ndim - 1))
    return np.fft.irfft(spectrum, length, axis=0)[:frames]
