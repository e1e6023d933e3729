"""Power of the tests of a report, and the number of participants that they need, by the distributions of scipy."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Literal

import numpy as np
import scipy

from midair.errors import InputError
from midair.study.statistics.detection import proportion_correct
from midair.study.statistics.paired import order_rank
from midair.validation import within

PowerTest = Literal["paired", "identification", "rating", "equivalence", "threshold"]


def power_paired(participants: int, *, effect: float, alpha: float = 0.05) -> float:
    """Power of a two-sided paired t-test, from the noncentral t distribution; `effect` is d_z."""
    within(participants, "participants", 2)
    df, shift = participants - 1, abs(effect) * participants**0.5
    edge = float(scipy.stats.t.isf(alpha / 2, df))
    # A two-sided test also rejects on the opposite side, which matters for small effects.
    return float(scipy.stats.nct.sf(edge, df, shift) + scipy.stats.nct.cdf(-edge, df, shift))


def power_rating(participants: int, *, effect: float, others: tuple[int, ...] = (), alpha: float = 0.05) -> float:
    """Power of the effect of two levels in an analysis of variance, with Bonferroni's correction for all its effects.

    `effect` is the difference over the standard deviation of a participant's mean rating at one level, `others` the
    levels of the further factors.
    """
    return power_paired(participants, effect=effect / 2**0.5, alpha=alpha / (2 ** (1 + len(others)) - 1))


def power_equivalence(participants: int, *, effect: float, alpha: float = 0.05) -> float:
    """Power of two one-sided tests (TOST) of conditions without a mean difference.

    `effect` is the margin over the standard deviation of the participants' differences. The integral over the observed
    standard deviation s of P(abs(mean) < margin - t s / sqrt(n)).
    """
    within(participants, "participants", 2)
    df = participants - 1
    edge, reach = float(scipy.stats.t.isf(alpha, df)), effect * participants**0.5

    def inside(share: float) -> float:  # of the distribution of s
        s = float(np.sqrt(scipy.stats.chi2.ppf(share, df) / df))
        return float(scipy.special.erf(max(reach - edge * s, 0.0) / 2**0.5))

    return float(scipy.integrate.quad(inside, 0, 1, limit=200)[0])


def power_identification(
    participants: int, *, effect: float, objects: int = 3, trials: int = 12, spread: float = 0.3, alpha: float = 0.05
) -> float:
    """Power of the binomial test that the share of correct answers of all participants is above chance.

    `effect` is the mean d' over participants, `spread` its standard deviation, `objects` the number of alternatives.
    The number of correct answers is taken as normal, with the variance between and within participants.
    """
    within(participants, "participants", 2)
    many = participants * trials
    node, weight = np.polynomial.hermite_e.hermegauss(31)
    share = proportion_correct(effect + spread * node, alternatives=objects)
    weight = weight / weight.sum()
    mean = float(weight @ share)
    between = float(weight @ (share - mean) ** 2)
    variance = participants * (trials * (mean * (1 - mean) - between) + trials**2 * between)
    fewest = float(scipy.stats.binom.isf(alpha, many, 1 / objects)) + 1
    return float(scipy.stats.norm.sf((fewest - 0.5 - many * mean) / np.sqrt(variance)))


def power_threshold(participants: int, *, effect: float, alpha: float = 0.05) -> float:
    """Probability that the limits of a median by order statistics exclude a bound (sign test; normal values).

    `effect` is the distance of the bound from the true median, over the standard deviation of the values.
    """
    within(participants, "participants", 2)
    rank, beyond = order_rank(participants, alpha=alpha) - 1, float(scipy.stats.norm.cdf(-abs(effect)))
    return float(sum(scipy.stats.binom.cdf(rank, participants, share) for share in (beyond, 1 - beyond)))


POWER: Mapping[PowerTest, Callable[..., float]] = {
    "paired": power_paired,
    "identification": power_identification,
    "rating": power_rating,
    "equivalence": power_equivalence,
    "threshold": power_threshold,
}


def participants_for(test: PowerTest, *, power: float = 0.8, most: int = 2000, **settings: float) -> int:
    """Smallest number of participants that reaches a power; raises InputError if `most` do not reach it."""
    reached = partial(POWER[test], **settings)
    high = 2
    while reached(high) < power:
        high *= 2
        if high > 2 * most:
            raise InputError(f"power: expected {power:g} with {most} participants, got less; state a larger effect")
    return next(many for many in range(max(2, high // 2), high + 1) if reached(many) >= power)
