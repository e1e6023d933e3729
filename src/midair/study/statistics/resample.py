"""Resampling: chance distributions by permutation, and limits by leaving out one person after the other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError

Array = NDArray[np.float64]
Scale = Literal["plain", "share", "positive", "correlation"]
"""Values without bounds; between 0 and 1; above 0; between -1 and 1."""


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
    people : int
        How many it rests on.
    """

    value: Array
    low: Array
    high: Array
    level: float
    people: int


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
        Share of turns for which ``|sum of z|`` is as large as observed.
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


def limits_over_people(
    statistic: Callable[[NDArray[Any]], Any],
    by_person: NDArray[Any],
    *,
    scale: Scale = "plain",
    level: float = 0.95,
    answers: Callable[[NDArray[Any]], Any] | None = None,
    added: tuple[float, float] = (1.0, 1.0),
    independent: bool = True,
) -> Interval:
    """Limits of a figure for people like these: the jackknife with Student's t (Efron and Stein, 1981).

    The figure is made again without each person. On a scale without bounds (the logit of a share, the logarithm of
    what is positive, Fisher's z of a correlation) its standard error is sqrt((n - 1) / n sum (without_i - mean)^2), and
    the limits are t on n - 1 degrees of freedom away. A share is drawn towards one half first, as by one wrong and one
    right answer more; without that, its limits cover up to .98 where nearly all are right. Where fewer answers are
    wrong (or right) than people took part, how people differ cannot be seen, and limits are at least as wide as those
    of independent answers; without that, they cover .92. A bootstrap of people (BCa) covers .83 to .86 for a 95 %
    interval of F with five people; this .94 to .97 (docs/decisions/0034-analysis.md).

    Parameters
    ----------
    statistic : callable
        Takes an array like `by_person`, with people in any number, and gives a number or an array.
    by_person : ndarray, shape (participant, ...)
        What each person contributes.
    scale : {"plain", "share", "positive", "correlation"}
        Bounds of the figure.
    level : float
        Confidence.
    answers : callable, optional
        Takes what the statistic takes and gives the number of answers that a "share" or "correlation" is a share of.
    added : tuple of float
        Answers of each kind that are added for the middle of the limits, and for their width.
    independent : bool
        Whether one of the answers says nothing of another, so that few wrong ones vary as a binomial number does.

    Returns
    -------
    Interval
        Of the shape of the statistic; NaN where the figure is the same whoever is left out, or at its bound: nothing
        then says how people differ.

    Raises
    ------
    InputError
        If there are fewer than five people: the limits would not cover what they promise. If the scale is unknown.
    """
    from scipy.stats import t as t_distribution

    if scale not in get_args(Scale):
        raise InputError(f"scale: expected one of {', '.join(get_args(Scale))}, got {scale!r}")
    people = len(by_person)
    if people < 5:
        raise InputError(
            f"limits over people: expected five people or more, got {people}; with fewer, limits do not cover what they"
            " promise"
        )
    value = np.asarray(statistic(by_person), float)
    others = [np.delete(by_person, i, axis=0) for i in range(people)]
    without = np.array([statistic(rest) for rest in others], float)
    if answers is not None and scale in ("share", "correlation"):
        total, left = np.asarray(answers(by_person), float), np.array([answers(rest) for rest in others], float)
        middle = _open(_drawn_in(value, total, added[0], scale), scale)
        moved = _open(_drawn_in(without, left, added[1], scale), scale)
    else:
        middle, moved = _open(value, scale), _open(without, scale)
    error = np.sqrt((people - 1) / people * ((moved - moved.mean(axis=0)) ** 2).sum(axis=0))
    half = error * float(t_distribution.ppf((1 + level) / 2, people - 1))
    if answers is not None and independent and scale in ("share", "correlation"):
        half = np.maximum(half, _binomial(value, np.asarray(answers(by_person), float), people, scale, level))
    # At a bound, and where leaving people out changes nothing but rounding, there is no error to go by.
    known = (error > 1e-12) & (_open(value, scale, reach=np.inf) == _open(value, scale))
    low, high = (np.where(known, _close(middle + side * half, scale), np.nan) for side in (-1, 1))
    # Drawn in, the middle is another than the figure, which its limits hold all the same.
    low, high = np.minimum(low, value), np.maximum(high, value)
    return Interval(value=value, low=low, high=high, level=level, people=people)


def _binomial(value: Array, total: Array, people: int, scale: Scale, level: float) -> Array:
    """Half the limits of answers that are independent, on the open scale; 0 unless fewer are of one kind than people.

    The logit of a share p of n answers has the variance 1 / (n p (1 - p)); Fisher's z of 2 p - 1 is half that logit.
    """
    from scipy.stats import norm

    share = value if scale == "share" else (1 + value) / 2
    few = total * np.minimum(share, 1 - share) < people
    drawn = (share * total + 1) / (total + 2)
    error = 1 / np.sqrt((total + 2) * drawn * (1 - drawn)) / (1 if scale == "share" else 2)
    return np.where(few, float(norm.ppf((1 + level) / 2)) * error, 0.0)


def _drawn_in(value: Array, total: Array, added: float, scale: Scale) -> Array:
    """A share, or the share (1 + r) / 2 of a correlation r, with answers of both kinds added."""
    low = -1.0 if scale == "correlation" else 0.0
    share = (value - low) / (1 - low)
    return low + (1 - low) * (share * total + added) / (total + 2 * added)


def _open(value: Array, scale: Scale, *, reach: float = 7.0) -> Array:
    """A figure on a scale without bounds; what lies at a bound comes to `reach` (a share of .999)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if scale == "share":
            return np.clip(np.log(value) - np.log1p(-value), -reach, reach)
        if scale == "correlation":
            return np.clip(np.arctanh(value), -reach / 2, reach / 2)
        return np.log(value) if scale == "positive" else value


def _close(value: Array, scale: Scale) -> Array:
    """Back from a scale without bounds."""
    if scale == "share":
        return 1 / (1 + np.exp(-value))
    if scale == "correlation":
        return np.tanh(value)
    return np.exp(value) if scale == "positive" else value
