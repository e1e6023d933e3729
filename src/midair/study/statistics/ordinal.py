"""A check of rating results that uses only the order of the ratings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from midair.study.statistics.anova import contrasts, effects
from midair.study.statistics.anova import rm_anova as analysis_of_variance
from midair.study.statistics.columns import cell_means, column, frame_of, levels, numbers
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
    """Repeat an analysis of variance on ranks, with sign-flip p-values, as columns effect, F, p_GG, p_sign.

    Answers are ranked within each participant, which removes individual levels and use of the scale. The ranks are
    analysed by `rm_anova`, which has the same arguments and errors; `sign_flip` of the contrasts adds a p-value without
    a distributional assumption, by random flips from `rng` for more than 13 participants. If the two analyses disagree,
    the result depends on treating ratings as interval data.
    """
    from scipy.stats import rankdata

    data = frame_of(table)
    people, person = levels(column(data, participant))
    ranks = numbers(data, value)
    for index in range(len(people)):
        ranks[person == index] = rankdata(ranks[person == index])
    ranked = data.assign(**{value: ranks})
    result = analysis_of_variance(ranked, value=value, participant=participant, within=within)
    cells = cell_means(ranked, value=value, participant=participant, within=within)
    answers = cells.mean.reshape(len(people), -1)
    p = [sign_flip(answers @ contrasts(cells.mean.shape[1:], effect).T, rng=rng) for effect in effects(list(within))]
    return result[["effect", "F", "p_GG"]].assign(p_sign=p)
