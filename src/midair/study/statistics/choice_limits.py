"""Confidence intervals over participants of accuracy, F, d' and kappa.

All functions take counts of trials as an integer array of shape (participant, presented, answered), unless stated
otherwise, and raise InputError for fewer than five participants.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import InputError
from midair.study.statistics.confusion import cohen_kappa, f_measure
from midair.study.statistics.detection import d_prime_of_share, d_prime_yes_no
from midair.study.statistics.resample import Interval, limits_over_people

if TYPE_CHECKING:
    from collections.abc import Callable

    from midair.study.statistics.detection import Sensitivity

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


def kappa_limits(by_person: Counts) -> Interval:
    """Confidence interval of Cohen's kappa.

    With m objects presented and answered equally often, 1 - kappa is the share of wrong answers times m / (m - 1); the
    number of answers is scaled accordingly.
    """
    often = 2 * (1 - 1 / by_person.shape[1])
    return limits_over_people(
        lambda counts: cohen_kappa(counts.sum(axis=0)),
        by_person,
        scale="correlation",
        answers=lambda counts: often * counts.sum(),
    )


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
    """Number of times each object was presented or answered."""
    table = counts.sum(axis=0)
    return np.asarray(table.sum(axis=1) + table.sum(axis=0)[: len(table)], np.float64)
