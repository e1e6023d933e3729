"""The 65535 binary patterns of the paper's simulation (paper, 5.1): each channel silent or loud, not all silent."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from midair.errors import InputError
from midair.model import SensorGrid


def binary_patterns(count: int | None = None, *, seed: int = 0, channels: int = 16) -> NDArray[np.int64]:
    """Binary patterns in a random order, so that the first few are a representative sample of all.

    Parameters
    ----------
    count : int, optional
        All 2^channels - 1 patterns if None.
    seed : int
        Seed of the order.
    channels : int
        At most 16.

    Returns
    -------
    ndarray of int, shape (pattern,)
        Bit k is 1 if channel k is loud. Patterns are unique, and none is 0.

    Raises
    ------
    InputError
        If `count` exceeds the number of patterns, or `channels` is out of range.
    """
    if not 1 <= channels <= 16:
        raise InputError(f"channels: expected 1 to 16, got {channels}")
    every = 2**channels - 1
    if count is not None and not 1 <= count <= every:
        raise InputError(f"count of patterns: expected 1 to {every}, got {count}")
    return np.random.default_rng(seed).permutation(np.arange(1, every + 1))[:count]


def channel_amplitudes(patterns: ArrayLike, sensor: SensorGrid | None = None) -> NDArray[np.float64]:
    """Amplitude, 0 or 1, of each channel in each pattern, shape (pattern, channel); bit k of a pattern is channel k."""
    bits = np.asarray(patterns, np.int64)[:, None] >> np.arange((sensor or SensorGrid()).count)
    return (bits & 1).astype(np.float64)
