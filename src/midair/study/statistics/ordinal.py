"""Ratings are ordinal: a check that uses nothing but their order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.anova import rm_anova as analysis_of_variance
from midair.study.statistics.cell_averages import cell_means
from midair.study.statistics.columns import column, frame_of, levels, numbers
from midair.study.statistics.resample import sign_flip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame


def ordinal_check(
    table: DataFrame | Mapping[str, Any],
    *,
    value: str,
    participant: str,
    within: Sequence[str],
    rng: np.random.Generator,
) -> DataFrame:
    """Repeat an analysis of variance on ranks, with p by turning signs.

    Each person's answers are ranked among that person's own, which removes the person's level and use of the scale.
    The ranks go through the repeated-measures analysis; beside its p stands a p that assumes no distribution: the
    contrasts of whole people change sign (`sign_flip`).
    Where this and the plain analysis of variance disagree, the result depends on taking ratings for distances.

    Parameters
    ----------
    table, value, participant, within
        As for `rm_anova`.
    rng : Generator
        Draws the random turns, beyond 13 people.

    Returns
    -------
    DataFrame
        Columns effect, F, p_GG, p_sign.

    Raises
    ------
    InputError, NonFiniteError
        As for `rm_anova`.
    """
    from scipy.stats import rankdata

    data = frame_of(table)
    people, person = levels(column(data, participant))
    ranks = numbers(data, value)
    for who in range(len(people)):
        ranks[person == who] = rankdata(ranks[person == who])
    ranked = data.assign(**{value: ranks})
    result = analysis_of_variance(ranked, value=value, participant=participant, within=within)
    cells = cell_means(ranked, value=value, participant=participant, within=within)
    answers = cells.mean.reshape(len(people), -1)
    p = [sign_flip(answers @ contrasts(cells.mean.shape[1:], effect).T, rng=rng) for effect in effects(list(within))]
    return result[["effect", "F", "p_GG"]].assign(p_sign=p)
