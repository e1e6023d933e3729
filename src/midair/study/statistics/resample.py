"""Resampling: chance distributions by permutation, intervals by drawing people again."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chance:
    """A figure beside what chance makes of it.

    Attributes
    ----------
    value : float
        What was observed.
    distribution : ndarray, shape (draw,)
        The same figure when the hypothesis of no effect holds.
    p : float
        Share of the distribution at least as extreme as the value, which counts as one of its draws.
    """

    value: float
    distribution: Array
    p: float

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return float(self.distribution.mean())

    @property
    def range95(self) -> tuple[float, float]:
        """Middle 95 % of the distribution."""
        low, high = np.quantile(self.distribution, [0.025, 0.975])
        return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interval:
    """A figure with its limits.

    Attributes
    ----------
    value, low, high : ndarray
        The figure and its limits, all of one shape.
    level : float
        Confidence.
    """

    value: Array
    low: Array
    high: Array
    level: float


def percentile_p(value: float, distribution: Array) -> float:
    """Share of a distribution at or above a value, the value included (Phipson and Smyth, 2010)."""
    # Draws that are equal to the value but for rounding count.
    slack = 1e-12 * max(1.0, abs(value))
    return float((1 + np.count_nonzero(distribution >= value - slack)) / (1 + len(distribution)))


def sign_flip(z: NDArray[Any], *, rng: np.random.Generator, draws: int = 10_000) -> float:
    """P-value of a mean that is not zero, by turning the sign of whole people.

    Exact, over all 2^n turns, up to 13 people; by random turns above. Two-sided.

    Parameters
    ----------
    z : ndarray, shape (participant,) or (participant, contrast)
        A difference, or the contrasts of one effect, of each person; symmetric about zero if there is no effect.
    rng : Generator
        Draws the random turns.
    draws : int
        Number of random turns.

    Returns
    -------
    float
        Share of turns for which |sum of z| is as large as observed.
    """
    z = np.asarray(z, float).reshape(len(z), -1)
    if len(z) < 2:
        raise InputError(f"participants: expected two or more to turn signs, got {len(z)}")
    observed = float((z.sum(axis=0) ** 2).sum())
    # All 2^13 turns are fewer than the random ones would be.
    if len(z) <= 13:
        turns = 1.0 - 2.0 * ((np.arange(2 ** len(z))[:, None] >> np.arange(len(z))) & 1)
        size = ((turns @ z) ** 2).sum(axis=1)
        return float(np.mean(size >= observed * (1 - 1e-9)))
    size = ((rng.choice([-1.0, 1.0], size=(draws, len(z))) @ z) ** 2).sum(axis=1)
    return percentile_p(observed, size)


def bootstrap(
    statistic: Callable[[NDArray[Any]], Any],
    by_person: NDArray[Any],
    *,
    rng: np.random.Generator,
    draws: int = 2000,
    level: float = 0.95,
) -> Interval:
    """Limits of a figure by drawing people with replacement: bias-corrected and accelerated (Efron, 1987).

    Parameters
    ----------
    statistic : callable
        Takes an array like `by_person`, with people in any number, and gives a number or an array.
    by_person : ndarray, shape (participant, ...)
        What each person contributes.
    rng : Generator
        Draws the people.
    draws : int
        Number of draws.
    level : float
        Confidence.

    Returns
    -------
    Interval
        Of the shape of the statistic. With fewer than about ten people the limits are too narrow; say so.

    Raises
    ------
    InputError
        If there is one person: nothing is known then about others.
    """
    people = len(by_person)
    if people < 2:
        raise InputError(f"participants: expected two or more to draw from, got {people}; an interval needs others")
    value = np.asarray(statistic(by_person), float)
    drawn = np.array([statistic(by_person[rng.integers(people, size=people)]) for _ in range(draws)], float)
    left = np.array([statistic(np.delete(by_person, i, axis=0)) for i in range(people)], float)
    share = _bca_shares(value, drawn, left, level)
    ordered = np.sort(drawn, axis=0)
    low, high = (_quantile(ordered, part) for part in share)
    return Interval(value=value, low=low, high=high, level=level)


def _bca_shares(value: Array, drawn: Array, left: Array, level: float) -> tuple[Array, Array]:
    """Which quantiles of the draws are the limits."""
    from scipy.stats import norm

    below = (drawn < value).mean(axis=0) + (drawn == value).mean(axis=0) / 2
    # A value beyond all draws would have an infinite bias.
    bias = norm.ppf(np.clip(below, 1 / (2 * len(drawn)), 1 - 1 / (2 * len(drawn))))
    away = left.mean(axis=0) - left
    spread = (away**2).sum(axis=0) ** 1.5
    skew = np.where(spread > 0, (away**3).sum(axis=0) / (6 * np.where(spread > 0, spread, 1)), 0)
    z = float(norm.ppf((1 + level) / 2))
    low, high = (bias + (bias + end) / (1 - skew * (bias + end)) for end in (-z, z))
    return np.asarray(norm.cdf(low), np.float64), np.asarray(norm.cdf(high), np.float64)


def _quantile(ordered: Array, share: Array) -> Array:
    """Quantile of sorted draws along the first axis, a different one for each entry."""
    place = np.clip(share, 0, 1) * (len(ordered) - 1)
    low = np.floor(place).astype(int)
    high = np.minimum(low + 1, len(ordered) - 1)
    pick = np.take_along_axis
    first, second = (pick(ordered, np.asarray(row)[None], axis=0)[0] for row in (low, high))
    return np.asarray(first + (place - low) * (second - first))
