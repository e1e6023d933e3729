"""Channels that cannot be trusted: dead ones and clipped ones."""

import numpy as np
from numpy.typing import NDArray

from midair.model import Recording
from midair.validation import positive


def dead_channels(recording: Recording) -> NDArray[np.bool_]:
    """Which channels never change, shape (row, column)."""
    return np.ptp(recording.samples, axis=0) == 0


def clipped_share(recording: Recording, *, full_scale: float | None = None) -> NDArray[np.float64]:
    """Share of the frames at which each channel stands at its limit.

    Parameters
    ----------
    recording : Recording
        What came.
    full_scale : float, optional
        Limit of the converter on either side, in the recording's unit. If it is not known, a channel counts as clipped
        where it stays at its own highest or lowest value for three frames or more.

    Returns
    -------
    ndarray, shape (row, column)
        0 to 1; 0 for a dead channel where the limit is not known.
    """
    samples = recording.samples
    if full_scale is not None:
        # The converter's largest code is one step below its limit.
        limit = positive(full_scale, "full scale", recording.unit) * (1 - 1e-4)
        return np.asarray((np.abs(samples) >= limit).mean(axis=0), np.float64)
    at_top = _in_runs(samples == samples.max(axis=0))
    at_bottom = _in_runs(samples == samples.min(axis=0))
    return np.asarray(np.where(dead_channels(recording), 0.0, (at_top | at_bottom).mean(axis=0)), np.float64)


def _in_runs(flag: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The flags that belong to a run of three or more along the first axis."""
    whole = np.zeros_like(flag)
    if len(flag) >= 3:
        triple = flag[:-2] & flag[1:-1] & flag[2:]
        whole[:-2] |= triple
        whole[1:-1] |= triple
        whole[2:] |= triple
    return whole
