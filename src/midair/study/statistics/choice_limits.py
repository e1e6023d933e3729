"""Limits over people of the figures of choices: share of right answers, F, d', kappa; and d' of two answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.statistics.confusion import cohen_kappa, f_measure
from midair.study.statistics.detection import d_prime_of_share, d_prime_yes_no
from midair.study.statistics.resample import Interval, limits_over_people

if TYPE_CHECKING:
    from collections.abc import Callable

    from midair.study.statistics.detection import Sensitivity

Array = NDArray[np.float64]
Counts = NDArray[Any]


def share_limits(by_person: Counts) -> Interval:
    """Limits of the share of right answers.

    Parameters
    ----------
    by_person : ndarray of int, shape (participant, presented, answered)
        Number of trials.

    Raises
    ------
    InputError
        If there are fewer than five people; so for all functions of this file.
    """
    return limits_over_people(_share, by_person, scale="share", answers=np.sum)


def f_limits(by_person: Counts) -> Interval:
    """Limits of F of each object, shape (object,).

    F is the share 2 hits / (presented + answered). It rests on fewer wrong answers than the share of right ones, and
    less is added to it: half an answer to the middle, .85 to the width. So, and with one answer for the other figures,
    the limits cover best in simulated studies. Presented and answered are not independent of each other.
    """
    added = (0.5, 0.85)
    return limits_over_people(
        lambda counts: f_measure(counts.sum(axis=0)),
        by_person,
        scale="share",
        answers=_named,
        added=added,
        independent=False,
    )


def macro_f_limits(by_person: Counts) -> Interval:
    """Limits of the mean of F over the objects."""
    return limits_over_people(
        lambda counts: float(f_measure(counts.sum(axis=0)).mean()), by_person, scale="share", answers=np.sum
    )


def d_prime_limits(by_person: Counts) -> Interval:
    """Limits of d' of an unbiased choice: those of the share of right answers, as d'."""
    share, alternatives = share_limits(by_person), by_person.shape[2]
    value, low, high = (
        np.asarray(d_prime_of_share(float(one), alternatives=alternatives) if np.isfinite(one) else np.nan)
        for one in (share.value, share.low, share.high)
    )
    return Interval(value=value, low=low, high=high, level=share.level, people=share.people)


def kappa_limits(by_person: Counts) -> Interval:
    """Limits of Cohen's kappa.

    With m objects presented equally often and answered so, 1 - kappa is the share of wrong answers times m / (m - 1);
    the answers are counted so that one wrong answer more is one wrong answer more.
    """
    often = 2 * (1 - 1 / by_person.shape[1])
    return limits_over_people(
        lambda counts: cohen_kappa(counts.sum(axis=0)),
        by_person,
        scale="correlation",
        answers=lambda counts: often * counts.sum(),
    )


def two_answers_limits(measure: Callable[[int, int, int, int], Sensitivity], by_person: Counts) -> Interval:
    """Limits of d' from yes and no, or from same and different.

    Parameters
    ----------
    measure : callable
        `d_prime_yes_no` or `d_prime_same_different`.
    by_person : ndarray of int, shape (participant, 4)
        Hits, signals, false alarms, blanks.

    Raises
    ------
    InputError
        If there are fewer than five people, or too few signals or blanks of all of them together: 60 of yes and no, 240
        of same and different, where the limits hold a true d' of .5 in .89 of studies with 60 and .92 with 120.
    """
    fewest, needed = int(by_person[:, [1, 3]].sum(axis=0).min()), 60 if measure is d_prime_yes_no else 240
    if len(by_person) >= 5 and fewest < needed:
        raise InputError(
            f"limits over people: expected {needed} signals and {needed} blanks or more in all, got {fewest} of one;"
            " with fewer, limits do not cover what they promise"
        )
    return limits_over_people(lambda people: measure(*people.sum(axis=0).tolist()).d_prime, by_person)


def _share(counts: Counts) -> float:
    table = counts.sum(axis=0)
    return float(np.trace(table) / table.sum())


def _named(counts: Counts) -> Array:
    """How often each object was presented or answered."""
    table = counts.sum(axis=0)
    return np.asarray(table.sum(axis=1) + table.sum(axis=0)[: len(table)], np.float64)
