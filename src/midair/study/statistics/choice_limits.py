"""Limits over people of the figures of choices: share of right answers, F, d', kappa."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.study.statistics.confusion import cohen_kappa, f_measure
from midair.study.statistics.detection import d_prime_of_share
from midair.study.statistics.resample import Interval, limits_over_people

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
    less is added to it: half an answer to the middle, .8 to the width. So, and with one answer for the other figures,
    the limits cover best in simulated studies.
    """
    return limits_over_people(
        lambda counts: f_measure(counts.sum(axis=0)), by_person, scale="share", answers=_named, added=(0.5, 0.8)
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


def _share(counts: Counts) -> float:
    table = counts.sum(axis=0)
    return float(np.trace(table) / table.sum())


def _named(counts: Counts) -> Array:
    """How often each object was presented or answered."""
    table = counts.sum(axis=0)
    return np.asarray(table.sum(axis=1) + table.sum(axis=0)[: len(table)], np.float64)
