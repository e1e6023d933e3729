"""Delay of each channel from the slope of its phase."""

import numpy as np

from midair.array_types import Array, Complex
from midair.errors import BandError


def channel_delay(frequency: Array, response: Complex, uncertainty: Array) -> tuple[Array, Array]:
    """Fit the delay tau of the line phase = phase_0 - 2 pi f tau by weighted least squares.

    This is the group delay, averaged over the bins; a sensor's resonances contribute through their phase. At least
    three bins in Hz, close enough that the phase changes by less than half a turn between two of them; response and its
    phase uncertainty in rad have the shape (bin, channel). Returns delay and uncertainty in s, shape (channel,); a
    channel without response gets 0 and infinity.
    """
    if len(frequency) < 3:
        raise BandError(f"delay: expected three bins or more, got {len(frequency)}")
    heard = (np.abs(response) > 0).all(axis=0)
    phase = np.unwrap(np.angle(np.where(heard, response, 1)), axis=0)
    # Limit the weights: unknown phases get almost no weight, exact ones a finite weight.
    weight = 1 / np.maximum(np.where(np.isfinite(uncertainty), uncertainty, 1e6), 1e-9) ** 2
    total = weight.sum(axis=0)
    turn = 2 * np.pi * frequency[:, None]
    # Centre on the weighted mean, so that slope and intercept are independent.
    away = turn - (weight * turn).sum(axis=0) / total
    spread = (weight * away**2).sum(axis=0)
    slope = (weight * away * phase).sum(axis=0) / spread
    return np.where(heard, -slope, 0.0), np.where(heard, 1 / np.sqrt(spread), np.inf)


def upper_half(frequency: Array) -> slice:
    """Upper half of the bins, where a delay is most visible and a high-pass filter least; all bins if few."""
    first = int(np.searchsorted(frequency, (frequency[0] + frequency[-1]) / 2))
    return slice(first if len(frequency) - first >= 3 else 0, None)
