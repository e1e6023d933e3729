"""Signal detection theory: sensitivity d' and criterion.

Source: Macmillan and Creelman, Detection Theory (2005), chapters 1, 2, 7, 9.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy

from midair.array_types import Array
from midair.errors import InputError
from midair.validation import within


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Sensitivity d'."""

    d_prime: float
    """In standard deviations of the internal noise."""
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


def d_prime_choice(correct: int, total: int, *, alternatives: int) -> Sensitivity:
    """Sensitivity d' of a forced choice among m alternatives, for an observer without bias.

    A rate of 0 or 1 is replaced by (hits + 1/2) / (total + 1).
    """
    _check_counts((correct, total))
    corrected = correct in (0, total)
    rate = (correct + 0.5) / (total + 1) if corrected else correct / total
    return Sensitivity(d_prime=d_prime_of_share(rate, alternatives=alternatives), corrected=corrected)


def _check_counts(*counts: tuple[int, int]) -> None:
    for hits, total in counts:
        if not 0 <= hits <= total or total < 1:
            raise InputError(f"proportion: expected 0 <= hits <= total and total >= 1, got {hits} of {total}")


def d_prime_yes_no(hits: int, signals: int, false_alarms: int, blanks: int) -> Sensitivity:
    """D' and criterion of a yes-no task, with the log-linear correction (Hautus, 1995): counts + 1/2, totals + 1.

    `hits` "yes" answers follow `signals` signals, `false_alarms` follow `blanks` blanks.
    """
    _check_counts((hits, signals), (false_alarms, blanks))
    hit, alarm = (
        float(scipy.stats.norm.ppf((yes + 0.5) / (total + 1)))
        for yes, total in ((hits, signals), (false_alarms, blanks))
    )
    return Sensitivity(d_prime=hit - alarm, criterion=-(hit + alarm) / 2, corrected=True)


def d_prime_same_different(hits: int, different: int, false_alarms: int, same: int) -> Sensitivity:
    """D' of a same-different task, for an observer with the differencing rule.

    P("different" | same) = 2 Phi(-k / sqrt 2); P("different" | different) = Phi((d' - k) / sqrt 2) + Phi((-d' - k) /
    sqrt 2). Macmillan and Creelman, chapter 9; 1/2 is added to counts and 1 to totals. `criterion` is the distance k;
    d' is 0 if the hit rate does not exceed the false-alarm rate.
    """
    _check_counts((hits, different), (false_alarms, same))
    hit, alarm = (hits + 0.5) / (different + 1), (false_alarms + 0.5) / (same + 1)
    k = float(-np.sqrt(2) * scipy.stats.norm.ppf(alarm / 2))

    def excess(d: float) -> float:
        return float(scipy.stats.norm.cdf((d - k) / np.sqrt(2)) + scipy.stats.norm.cdf((-d - k) / np.sqrt(2)) - hit)

    d = 0.0 if excess(0.0) >= 0 else float(scipy.optimize.brentq(excess, 0.0, 40.0))
    return Sensitivity(d_prime=d, criterion=k, corrected=True)


@cache
def _nodes() -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Hermite quadrature; cached, since they take a millisecond."""
    node, weight = np.polynomial.hermite_e.hermegauss(81)
    return node, weight
