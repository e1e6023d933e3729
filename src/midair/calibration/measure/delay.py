"""The delay of each channel, from the slope of its phase."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import BandError

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def channel_delay(frequency: Array, response: Complex, uncertainty: Array) -> tuple[Array, Array]:
    """Delay tau of the straight line phase = phase_0 - 2 pi f tau, by weighted least squares.

    It is the group delay, averaged over the bins; a sensor's own resonances count as far as they turn the phase there.

    Parameters
    ----------
    frequency : ndarray, shape (bin,)
        Three or more, in Hz, so close that the phase turns by less than half a turn from one to the next.
    response : ndarray of complex, shape (bin, channel)
        A channel whose response is 0 has no delay: 0, infinitely uncertain.
    uncertainty : ndarray, shape (bin, channel)
        Uncertainty of the phase, in rad.

    Returns
    -------
    delay, uncertainty : ndarray, shape (channel,)
        In s.

    Raises
    ------
    BandError
        With fewer than three bins.
    """
    if len(frequency) < 3:
        raise BandError(f"delay: expected three bins or more, got {len(frequency)}")
    heard = (np.abs(response) > 0).all(axis=0)
    phase = np.unwrap(np.angle(np.where(heard, response, 1)), axis=0)
    # What is not known weighs next to nothing, and what is known perfectly not infinitely much.
    weight = 1 / np.maximum(np.where(np.isfinite(uncertainty), uncertainty, 1e6), 1e-9) ** 2
    total = weight.sum(axis=0)
    turn = 2 * np.pi * frequency[:, None]
    # About the weighted mean, where the slope does not depend on the intercept.
    away = turn - (weight * turn).sum(axis=0) / total
    spread = (weight * away**2).sum(axis=0)
    slope = (weight * away * phase).sum(axis=0) / spread
    return np.where(heard, -slope, 0.0), np.where(heard, 1 / np.sqrt(spread), np.inf)


def upper_half(frequency: Array) -> slice:
    """The bins above the middle of the band, where a delay shows best and a high-pass least; all if they are few."""
    first = int(np.searchsorted(frequency, (frequency[0] + frequency[-1]) / 2))
    return slice(first if len(frequency) - first >= 3 else 0, None)
