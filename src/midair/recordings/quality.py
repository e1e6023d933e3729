"""Channels that cannot be trusted: dead ones, clipped ones, and ones that hold nothing but noise."""

import numpy as np
from numpy.typing import NDArray

from midair.model import Recording
from midair.reel import Moments, moments


def dead_channels(recording: Recording) -> NDArray[np.bool_]:
    """Which channels never change, shape (row, column)."""
    found = moments(recording.samples)
    return found.least == found.greatest


def at_limit(samples: NDArray[np.float64], full_scale: float) -> NDArray[np.bool_]:
    """Which samples stand at the limit of their converter, same shape: the one rule for clipping.

    Parameters
    ----------
    samples : ndarray, any shape
        In the unit of `full_scale`.
    full_scale : float
        Limit of the converter on either side.
    """
    # The converter's largest code is one step below its limit; 1e-4 of it is more than a step of 14 bits.
    return np.abs(samples) >= full_scale * (1 - 1e-4)


def suspicious(recording: Recording) -> tuple[str, ...]:
    """A sentence for the channels that never change and one for those that hold only a white floor.

    A floor is a channel more than ten times quieter than the median channel whose successive differences are those of
    independent numbers: von Neumann's ratio, their mean square over the variance, is within four standard errors of 2
    (J. von Neumann, Ann. Math. Stat. 12, 1941: variance 4 (n - 2) / (n^2 - 1)).
    """
    found = moments(recording.samples)
    dead = (found.least == found.greatest).ravel()
    report: list[str] = []
    if recording.frames > 1 and dead.any():
        first = found.first.ravel()
        values = ", ".join(f"{i} ({first[i]:g} {recording.unit})" for i in np.flatnonzero(dead))
        report.append(f"Channels that never change, dead or saturated: {values}.")
    if recording.frames >= 100 and not dead.all():
        spread = found.spread.ravel()
        floor = ~dead & (spread < 0.1 * np.median(spread[~dead])) & _white(found, recording.frames)
        if floor.any():
            names = ", ".join(str(i) for i in np.flatnonzero(floor))
            report.append(f"Channels that hold only a white floor, more than ten times below the others: {names}.")
    return tuple(report)


def _white(found: Moments, n: int) -> NDArray[np.bool_]:
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.square(found.step / found.spread).ravel()
    return np.abs(ratio - 2) < 4 * np.sqrt(4 * (n - 2) / (n**2 - 1))
