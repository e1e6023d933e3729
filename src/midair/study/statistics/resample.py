"""Resampling: permutation tests, and jackknife confidence intervals over participants."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError

Scale = Literal["plain", "share", "positive", "correlation"]
"""Unbounded values; between 0 and 1; above 0; between -1 and 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chance:
    """Statistic with its distribution under the null hypothesis."""

    value: float
    """Observed value."""
    distribution: Array
    """Values under the null hypothesis, shape (draw,)."""
    p: float
    """Share of the distribution at least as extreme as the value, which counts as one draw."""

    @property
    def mean(self) -> float:
        """Mean of the distribution."""
        return float(self.distribution.mean())

    @property
    def range95(self) -> tuple[float, float]:
        """2.5th and 97.5th percentile of the distribution."""
        low, high = np.quantile(self.distribution, [0.025, 0.975])
        return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interval:
    """Statistic with its confidence interval."""

    value: Array
    low: Array
    high: Array
    """`value`, `low`, `high` have the same shape."""
    level: float
    """Confidence level."""
    people: int
    """Number of participants."""


def percentile_p(value: float, distribution: Array) -> float:
    """Share of a distribution at or above a value, the value included (Phipson and Smyth, 2010)."""
    # Draws equal to the value up to rounding are counted.
    slack = 1e-12 * max(1.0, abs(value))
    return float((1 + np.count_nonzero(distribution >= value - slack)) / (1 + len(distribution)))


def sign_flip(z: NDArray[Any], *, rng: np.random.Generator, draws: int = 10_000) -> float:
    """Two-sided p-value of a nonzero mean by flipping the signs of whole participants.

    `z`, shape (participant,) or (participant, contrast), holds a difference or the contrasts of one effect, symmetric
    about zero under the null hypothesis. The p-value is the share of sign patterns for which ``|sum of z|`` is at least
    as large as observed: exact over all 2^n patterns for up to 13 participants, `draws` random patterns for more.
    """
    z = np.asarray(z, float).reshape(len(z), -1)
    if len(z) < 2:
        raise InputError(f"participants: expected two or more to flip signs, got {len(z)}")
    observed = float((z.sum(axis=0) ** 2).sum())
    # All 2^13 sign patterns are fewer than the random ones.
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
    """Confidence interval of a statistic over participants: the jackknife with Student's t (Efron and Stein, 1981).

    The statistic is recomputed without each participant. On an unbounded scale (logit of a share, logarithm of a
    positive value, Fisher's z of a correlation) its standard error is sqrt((n - 1) / n sum (without_i - mean)^2), and
    the limits are the t quantile with n - 1 degrees of freedom times that error away. Two corrections improve the
    coverage: shares are shrunk towards one half by `added` wrong and correct answers (otherwise the coverage rises to
    0.98 near a share of 1); and if fewer answers are wrong (or correct) than there are participants, the limits are at
    least as wide as those of independent answers (otherwise the coverage is 0.92). For F with five participants the
    coverage of a nominal 0.95 is 0.94 to 0.97; a bootstrap over participants (BCa) reaches 0.83 to 0.86
    (docs/decisions/0034-analysis.md). Raises InputError if there are fewer than five participants, where the coverage
    is too low, or the scale is unknown.

    `statistic` is a function of an array like `by_person`, shape (participant, ...), for any number of participants,
    that returns a number or an array; `answers` such a function that returns the number of answers behind a "share" or
    "correlation". `added` are the answers of each kind added for the centre of the interval, and for its width;
    `independent` answers have a binomial variance where few are wrong. The interval has the shape of the statistic; its
    limits are NaN if the statistic is at its bound or equal without any participant.
    """
    from scipy.stats import t as t_distribution

    if scale not in get_args(Scale):
        raise InputError(f"scale: expected one of {', '.join(get_args(Scale))}, got {scale!r}")
    people = len(by_person)
    if people < 5:
        raise InputError(
            f"limits over participants: expected five participants or more, got {people}; with fewer, the coverage is"
            " below the nominal level"
        )
    value = np.asarray(statistic(by_person), float)
    others = [np.delete(by_person, i, axis=0) for i in range(people)]
    without = np.array([statistic(rest) for rest in others], float)
    if answers is not None and scale in ("share", "correlation"):
        total, left = np.asarray(answers(by_person), float), np.array([answers(rest) for rest in others], float)
        middle = _to_open_scale(_shrink(value, total, added[0], scale), scale)
        moved = _to_open_scale(_shrink(without, left, added[1], scale), scale)
    else:
        middle, moved = _to_open_scale(value, scale), _to_open_scale(without, scale)
    error = np.sqrt((people - 1) / people * ((moved - moved.mean(axis=0)) ** 2).sum(axis=0))
    half = error * float(t_distribution.ppf((1 + level) / 2, people - 1))
    if answers is not None and independent and scale in ("share", "correlation"):
        half = np.maximum(half, _binomial_half(value, np.asarray(answers(by_person), float), people, scale, level))
    # At a bound, or if all leave-one-out values are equal, the standard error is unknown.
    known = (error > 1e-12) & (_to_open_scale(value, scale, reach=np.inf) == _to_open_scale(value, scale))
    low, high = (np.where(known, _from_open_scale(middle + side * half, scale), np.nan) for side in (-1, 1))
    # The centre is shrunk, so the limits are extended to include the statistic itself.
    low, high = np.minimum(low, value), np.maximum(high, value)
    return Interval(value=value, low=low, high=high, level=level, people=people)


def _binomial_half(value: Array, total: Array, people: int, scale: Scale, level: float) -> Array:
    """Half-width for independent answers on the open scale; 0 unless one kind is rarer than the participants.

    The logit of a share p of n answers has the variance 1 / (n p (1 - p)); Fisher's z of 2 p - 1 is half that logit.
    """
    from scipy.stats import norm

    share = value if scale == "share" else (1 + value) / 2
    few = total * np.minimum(share, 1 - share) < people
    drawn = (share * total + 1) / (total + 2)
    error = 1 / np.sqrt((total + 2) * drawn * (1 - drawn)) / (1 if scale == "share" else 2)
    return np.where(few, float(norm.ppf((1 + level) / 2)) * error, 0.0)


def _shrink(value: Array, total: Array, added: float, scale: Scale) -> Array:
    """A share, or the share (1 + r) / 2 of a correlation r, after `added` answers of both kinds are added."""
    low = -1.0 if scale == "correlation" else 0.0
    share = (value - low) / (1 - low)
    return low + (1 - low) * (share * total + added) / (total + 2 * added)


def _to_open_scale(value: Array, scale: Scale, *, reach: float = 7.0) -> Array:
    """Transform to an unbounded scale; values at a bound become `reach` (7: a share of 0.999)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        if scale == "share":
            return np.clip(np.log(value) - np.log1p(-value), -reach, reach)
        if scale == "correlation":
            return np.clip(np.arctanh(value), -reach / 2, reach / 2)
        return np.log(value) if scale == "positive" else value


def _from_open_scale(value: Array, scale: Scale) -> Array:
    """Inverse of `_to_open_scale`."""
    if scale == "share":
        return 1 / (1 + np.exp(-value))
    if scale == "correlation":
        return np.tanh(value)
    return np.exp(value) if scale == "positive" else value
