"""Ratings are ordinal: checks that use nothing but their order."""

from collections.abc import Sequence

import numpy as np

from midair.errors import InputError
from midair.study.anova import contrasts, effects
from midair.study.anova import rm_anova as analysis_of_variance
from midair.study.resample import sign_flip
from midair.study.table import Columns, Table, cell_means, levels, numbers


def ordinal_check(
    table: Columns, *, value: str, participant: str, within: Sequence[str], rng: np.random.Generator
) -> Table:
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
        For the random turns, beyond 13 people.

    Returns
    -------
    Table
        Columns effect, F, p_GG, p_sign.

    Raises
    ------
    InputError, NonFiniteError
        As for `rm_anova`.
    """
    from scipy.stats import rankdata

    data = Table.of(table)
    people, person = levels(data[participant])
    ranks = numbers(data, value)
    for who in range(len(people)):
        ranks[person == who] = rankdata(ranks[person == who])
    ranked = Table({**data, value: ranks})
    result = analysis_of_variance(ranked, value=value, participant=participant, within=within)
    cells = cell_means(ranked, value=value, participant=participant, within=within)
    answers = cells.mean.reshape(len(people), -1)
    p = [sign_flip(answers @ contrasts(cells.mean.shape[1:], effect).T, rng=rng) for effect in effects(list(within))]
    return Table({"effect": result["effect"], "F": result["F"], "p_GG": result["p_GG"], "p_sign": np.array(p)})


def cumulative_link(table: Columns, *, value: str, participant: str, factor: str) -> tuple[float, int, float]:
    """Likelihood-ratio test of one factor in a cumulative logit model with a level for each person.

    P(answer <= k) = logistic(cut_k - person - factor). Persons are fixed effects, which makes the test a little liberal
    with few answers a person; take it as a check. Fitted by statsmodels.

    Returns
    -------
    chi2, df, p : float, int, float

    Raises
    ------
    MissingExtraError
        If statsmodels is not installed.
    InputError
        If every answer is the same, or there is one level.
    """
    from scipy.stats import chi2

    data = Table.of(table)
    answer = np.unique(numbers(data, value), return_inverse=True)[1]
    people, person = levels(data[participant])
    order, level = levels(data[factor])
    if answer.max(initial=0) < 1 or len(order) < 2:
        raise InputError("cumulative link: expected answers that vary and two or more levels; there is nothing to fit")
    known = np.eye(len(people))[person][:, 1:]
    with_factor = np.hstack([known, np.eye(len(order))[level][:, 1:]])
    statistic = 2 * (_ordered_likelihood(answer, with_factor) - _ordered_likelihood(answer, known))
    df = len(order) - 1
    return max(statistic, 0.0), df, float(chi2.sf(max(statistic, 0.0), df))


def _ordered_likelihood(answer: np.ndarray, design: np.ndarray) -> float:
    from midair.errors import MissingExtraError

    try:
        from statsmodels.miscmodels.ordinal_model import OrderedModel
    except ImportError as missing:
        raise MissingExtraError("cumulative link: expected statsmodels, which is not installed; add it") from missing
    fit = OrderedModel(answer, design, distr="logit").fit(method="bfgs", disp=False, maxiter=500)
    return float(fit.llf)
