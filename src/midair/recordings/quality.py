"""Channels that cannot be trusted: dead ones, clipped ones, folded ones, and ones that hold nothing but noise."""

import numpy as np
from numpy.typing import NDArray

from midair.lazy_frames import LazyFrames, Moments, blocks, moments
from midair.model import Recording


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
    """A sentence for the channels that never change, for those that hold only a white floor, or clip, or are folded.

    A floor is a channel more than ten times quieter than the median channel whose successive differences are those of
    independent numbers: von Neumann's ratio, their mean square over the variance, is within four standard errors of 2
    (J. von Neumann, Ann. Math. Stat. 12, 1941: variance 4 (n - 2) / (n^2 - 1)).

    A channel clips whose greatest or least number comes in five places or more, 20 times or more in all, and more
    than four times as often as what lies just below it, within half a percent of the range: a sine has 2.4 times as
    much there at most. Where it lies at 0, it is no limit of a converter. Of less than 100 levels, as a tone has that
    fits the rate, it has to stand there three frames in a row, for a tone has its greatest number twice, and nowhere
    else; and the levels must be no steps of a coarse converter, all of one height.

    A recording may be a magnitude, of an acceleration or a force, if no number of it is below zero and it lies more
    below the middle of its range than above.
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
    clipped = _flat_tops(recording.samples, found)
    if clipped.any():
        names = ", ".join(str(i) for i in np.flatnonzero(clipped))
        report.append(f"Channels that stand at their greatest or least number again and again, clipped: {names}.")
    if recording.frames >= 100 and _folded(found):
        report.append(
            "No number is below zero: if this is a magnitude (of an acceleration, of a force), its vibration is folded "
            "and comes at other frequencies than were felt; take one axis instead."
        )
    return tuple(report)


def _folded(found: Moments) -> bool:
    """Whether no channel is ever below zero, and most lie on average in the lower two fifths of their range."""
    lively = found.least < found.greatest
    low = found.mean - found.least < (found.greatest - found.mean) / 1.5
    return bool(lively.any() and (found.least >= 0).all() and low[lively].mean() > 0.5)


def _flat_tops(samples: NDArray[np.float64] | LazyFrames, found: Moments) -> NDArray[np.bool_]:
    """Which channels clip, shape (channel,): one pass along the frames."""
    count = found.least.size
    least, greatest = found.least.ravel(), found.greatest.ravel()
    span = greatest - least
    near = 0.005 * span
    step = np.full(count, np.inf)
    at, below, visits = (np.zeros((2, count), np.int64) for _ in range(3))
    before = np.full((1, count), np.nan)
    for block in blocks(samples):
        part = block.reshape(len(block), count)
        rows = np.concatenate([before, part])
        change = np.abs(np.diff(rows, axis=0))
        step = np.minimum(step, np.min(change, axis=0, where=change > 0, initial=np.inf))
        for side, depth in enumerate((greatest - rows, rows - least)):
            top = depth == 0
            at[side] += top[1:].sum(axis=0)
            below[side] += ((depth > 0) & (depth <= np.maximum(near, 1.01 * step)))[1:].sum(axis=0)
            visits[side] += (top[1:] & ~top[:-1]).sum(axis=0)
        before = rows[-1:]
    held = (at >= 20) & (visits >= 5) & (np.stack([greatest, least]) != 0)
    tops = held & (at > 4 * below) & (span >= 100 * step)
    told = np.zeros(count, bool)
    if held.any():
        some = next(blocks(samples)).reshape(-1, count)
        for channel in np.flatnonzero(held.any(axis=0)):
            # A tone that was worked out comes by again a rounding beside where it was.
            x = np.rint((some[:, channel] - least[channel]) / span[channel] * 1e9)
            levels = np.unique(x)
            few = len(levels) < 100
            told[channel] = _flat_few(x, levels, held[:, channel]) if few else tops[:, channel].any()
    return told


def _flat_few(x: NDArray[np.float64], levels: NDArray[np.float64], sides: NDArray[np.bool_]) -> bool:
    """Whether a channel of few levels stands still at its ends alone, of levels that are not of one height.

    Sides are those that count: its greatest, its least.
    """
    if len(levels) < 3:
        return False
    ends = (sides[0] & (x[1:] == levels[-1])) | (sides[1] & (x[1:] == levels[0]))
    still = x[1:] == x[:-1]
    heights = np.diff(levels)
    multiples = heights / heights.min()
    coarse = np.abs(multiples - np.rint(multiples)).max() < 0.02
    # A tone that is not clipped has its greatest number twice in a row at most.
    came = (~still & ends).sum()
    return bool(not coarse and (still & ends).sum() > 1.5 * came and (still & ~ends).sum() <= 0.1 * came)


def _white(found: Moments, n: int) -> NDArray[np.bool_]:
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.square(found.step / found.spread).ravel()
    return np.abs(ratio - 2) < 4 * np.sqrt(4 * (n - 2) / (n**2 - 1))
