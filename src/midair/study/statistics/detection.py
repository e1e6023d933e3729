"""Signal detection theory: sensitivity d' and criterion; confidence intervals over participants.

Source: Macmillan and Creelman, Detection Theory (2005), chapters 1, 2, 7, 9.

The functions with limits over participants take counts of trials as an integer array of shape (participant, presented,
answered), unless stated otherwise, and raise InputError for fewer than five participants.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.confusion import Interval, f_measure, limits_over_people, wilson
from midair.validation import within


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Sensitivity d' with its confidence interval."""

    d_prime: float
    low: float
    high: float
    """`d_prime`, `low`, `high`: d' in standard deviations of the internal noise and its limits; NaN for unknown limits.
    """
    criterion: float = 0.0
    """Response bias: above 0 for a conservative observer (few "yes" or "different"); 0 if the task has none."""
    corrected: bool = False
    """Whether rates were corrected to obtain a finite d'."""


def proportion_correct(d_prime: Any, *, alternatives: int) -> Array:
    """Share of correct answers of an unbiased observer who chooses the largest of m internal values.

    The integral of phi(x - d') Phi(x)^(m - 1) over x, with the shape of `d_prime`, the distance of the correct
    alternative from the m - 1 others in standard deviations: 1/m at 0, and 0.634 at 1 with three alternatives.
    """
    within(alternatives, "alternatives", 2)
    node, weight = _nodes()
    inside = scipy.special.ndtr(np.asarray(d_prime, float)[..., None] + node) ** (alternatives - 1)
    # The quadrature weight is exp(-x^2 / 2), that is phi without its constant factor.
    return np.asarray(inside @ weight / np.sqrt(2 * np.pi))


def d_prime_of_share(share: float, *, alternatives: int) -> float:
    """Inverse of `proportion_correct`; infinite if no d' between -12 and 12 gives the share."""

    def excess(d: float) -> float:
        return float(proportion_correct(d, alternatives=alternatives)) - share

    edge = 12.0
    if excess(-edge) >= 0:
        return -np.inf
    return np.inf if excess(edge) <= 0 else float(scipy.optimize.brentq(excess, -edge, edge))


def d_prime_choice(correct: int, total: int, *, alternatives: int, level: float = 0.95) -> Sensitivity:
    """Sensitivity d' of a forced choice among m alternatives, for an observer without bias.

    A rate of 0 or 1 is replaced by (hits + 1/2) / (total + 1). The limits are those of Wilson's interval of the rate,
    whose InputError applies; they are infinite on the side where all (or no) answers are correct.
    """
    low, high = wilson(correct, total, level=level)
    corrected = correct in (0, total)
    rate = (correct + 0.5) / (total + 1) if corrected else correct / total
    found = [d_prime_of_share(share, alternatives=alternatives) for share in (rate, float(low), float(high))]
    # Wilson's limit is 0 or 1 there but for rounding, which d' would show as a number near 10.
    low, high = found[1] if correct else -np.inf, found[2] if correct < total else np.inf
    return Sensitivity(d_prime=found[0], low=low, high=high, corrected=corrected)


def d_prime_yes_no(hits: int, signals: int, false_alarms: int, blanks: int) -> Sensitivity:
    """D' and criterion of a yes-no task, with the log-linear correction (Hautus, 1995): counts + 1/2, totals + 1.

    `hits` "yes" answers follow `signals` signals, `false_alarms` follow `blanks` blanks. The limits use the normal
    approximation of Gourevitch and Galanter (1967) for independent trials. They are NaN with fewer than 20 signals or
    blanks, where the coverage of a nominal 0.95 rises to 0.98.
    """
    # Called only to check the counts.
    wilson([hits, false_alarms], [signals, blanks])
    rate = (np.array([hits, false_alarms]) + 0.5) / (np.array([signals, blanks]) + 1)
    z = scipy.stats.norm.ppf(rate)
    variance = rate * (1 - rate) / (np.array([signals, blanks]) * scipy.stats.norm.pdf(z) ** 2)
    half = 1.96 * float(np.sqrt(variance.sum())) if min(signals, blanks) >= 20 else np.nan
    d = float(z[0] - z[1])
    return Sensitivity(d_prime=d, low=d - half, high=d + half, criterion=float(-z.mean()), corrected=True)


def d_prime_same_different(hits: int, different: int, false_alarms: int, same: int) -> Sensitivity:
    """D' of a same-different task, for an observer with the differencing rule.

    P("different" | same) = 2 Phi(-k / sqrt 2); P("different" | different) = Phi((d' - k) / sqrt 2) + Phi((-d' - k) /
    sqrt 2). Macmillan and Creelman, chapter 9; 1/2 is added to counts and 1 to totals. `criterion` is the distance k;
    d' is 0 if the hit rate does not exceed the false-alarm rate. The limits are NaN: use `limits_over_people`.
    """
    # Called only to check the counts.
    wilson([hits, false_alarms], [different, same])
    hit, alarm = (hits + 0.5) / (different + 1), (false_alarms + 0.5) / (same + 1)
    k = float(-np.sqrt(2) * scipy.stats.norm.ppf(alarm / 2))

    def excess(d: float) -> float:
        return float(scipy.stats.norm.cdf((d - k) / np.sqrt(2)) + scipy.stats.norm.cdf((-d - k) / np.sqrt(2)) - hit)

    d = 0.0 if excess(0.0) >= 0 else float(scipy.optimize.brentq(excess, 0.0, 40.0))
    return Sensitivity(d_prime=d, low=np.nan, high=np.nan, criterion=k, corrected=True)


@cache
def _nodes() -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Hermite quadrature; cached, since they take a millisecond."""
    node, weight = np.polynomial.hermite_e.hermegauss(81)
    return node, weight


Counts = NDArray[Any]


def share_limits(by_person: Counts) -> Interval:
    """Confidence interval of the share of correct answers."""
    return limits_over_people(
        lambda counts: float(np.trace(counts.sum(axis=0)) / counts.sum()), by_person, scale="share", answers=np.sum
    )


def f_limits(by_person: Counts) -> Interval:
    """Confidence interval of F of each object, shape (object,).

    F is the share 2 hits / (presented + answered). It depends on fewer wrong answers than accuracy does, so fewer
    pseudo-answers are added: 0.5 for the centre, 0.85 for the width. These values gave the best coverage in simulated
    studies. Presented and answered counts are not independent, so the binomial width is no lower limit.
    """
    return limits_over_people(
        lambda counts: f_measure(counts.sum(axis=0)),
        by_person,
        scale="share",
        answers=_object_counts,
        added=(0.5, 0.85),
        independent=False,
    )


def macro_f_limits(by_person: Counts) -> Interval:
    """Confidence interval of the mean F over objects."""
    return limits_over_people(
        lambda counts: float(f_measure(counts.sum(axis=0)).mean()), by_person, scale="share", answers=np.sum
    )


def d_prime_limits(by_person: Counts) -> Interval:
    """Confidence interval of d' of an unbiased choice, converted from the interval of the share of correct answers."""
    share, alternatives = share_limits(by_person), by_person.shape[2]
    value, low, high = (
        np.asarray(d_prime_of_share(float(one), alternatives=alternatives) if np.isfinite(one) else np.nan)
        for one in (share.value, share.low, share.high)
    )
    return Interval(value=value, low=low, high=high, level=share.level, people=share.people)


def two_answers_limits(measure: Callable[[int, int, int, int], Sensitivity], by_person: Counts) -> Interval:
    """Confidence interval of d' of yes-no or same-different answers, by `d_prime_yes_no` or `d_prime_same_different`.

    `by_person` has the shape (participant, 4): hits, signals, false alarms, blanks. Raises InputError for fewer than
    five participants, or fewer than 60 (yes-no) or 240 (same-different) signals or blanks in all. With same-different
    answers and a true d' of 0.5, coverage is 0.89 with 60 trials and 0.92 with 120.
    """
    fewest, needed = int(by_person[:, [1, 3]].sum(axis=0).min()), 60 if measure is d_prime_yes_no else 240
    if len(by_person) >= 5 and fewest < needed:
        raise InputError(
            f"limits over participants: expected {needed} or more signals and blanks in all, got {fewest} of one kind;"
            " with fewer, the coverage is below the nominal level"
        )
    return limits_over_people(lambda people: measure(*people.sum(axis=0).tolist()).d_prime, by_person)


def _object_counts(counts: Counts) -> Array:
    table = counts.sum(axis=0)
    return np.asarray(table.sum(axis=1) + table.sum(axis=0)[: len(table)], np.float64)
