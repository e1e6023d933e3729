"""Pairwise comparisons of the levels of factors after an analysis of variance."""

from __future__ import annotations

from itertools import combinations, product
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import InputError
from midair.study.statistics.anova import between_groups, noncentral_t_limits
from midair.study.statistics.columns import cell_means, frame_of
from midair.study.statistics.paired import holm

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray
    from pandas import DataFrame

    from midair.study.statistics.anova import Groups

    Array = NDArray[np.float64]


def pairwise(
    table: DataFrame | Mapping[str, Any],
    *,
    value: str,
    participant: str,
    within: Sequence[str],
    between: Sequence[str] = (),
    effects: Sequence[str] = (),
) -> DataFrame:
    """Compare each pair of levels of each factor; the effects and means are those of `rm_anova`.

    For within-subject factors: the t-test of each participant's difference (paired t), which does not assume
    sphericity, with Holm's correction (1979) for the pairs of the effect. With groups, the variance of the differences
    is pooled within groups, with n - G degrees of freedom, and group means are unweighted. For between-subject factors:
    the test of Tukey and Kramer on the means of the participants, by the studentised range.

    For an interaction such as "surface:object": the pairs of its cells that differ in one factor, with Holm's
    correction for all of them. Raises InputError as `rm_anova`; also if an effect names an unknown factor.

    `effects` are factors, or interactions with factors joined by colons; all factors by default.

    Returns the columns effect, first, second, difference (first - second), low, high (95 % limits, uncorrected), df, t,
    p, p_pairs (corrected), correction ("Holm" or "Tukey"), d, d_low, d_high, note. `d` is the difference over the
    standard deviation of the differences (d_z; within) or of the people of a group (Cohen's d; between); its limits are
    from the noncentral t. Where all differences are equal the tests are NaN, and `note` gives the reason.
    """
    from pandas import DataFrame

    cells = cell_means(table, value=value, participant=participant, within=within)
    groups = between_groups(frame_of(table), cells, participant, list(between))
    if (people := len(cells.participants)) <= len(groups.sizes):
        raise InputError(f"participants: expected {len(groups.sizes) + 1} or more, got {people}; no error term")
    names = [*between, *within]
    levels = [*groups.levels, *cells.levels]
    rows: list[dict[str, object]] = []
    for effect in effects or names:
        chosen = effect.split(":")
        if unknown := set(chosen) - set(names):
            raise InputError(f"effects: expected factors among {', '.join(names)}, got {', '.join(sorted(unknown))}")
        order = [names.index(name) for name in chosen]
        found: list[dict[str, object]] = []
        for pair in combinations(product(*(range(len(levels[i])) for i in order)), 2):
            if sum(a != b for a, b in zip(*pair, strict=True)) > 1:
                continue
            first, second = (dict(zip(order, cell, strict=True)) for cell in pair)
            shown = (", ".join(str(levels[i][k]) for i, k in cell.items()) for cell in (first, second))
            row = dict(zip(("effect", "first", "second"), (effect, *shown), strict=True))
            found.append(row | _comparison(cells.mean, groups, first, second))
        tukey = len(chosen) == 1 and order[0] < len(between)
        _correct(found, len(levels[order[0]]) if tukey else 0)
        rows += found
    return DataFrame(rows, columns=[*(name for name in rows[0] if name != "note"), "note"])


def _comparison(y: Array, groups: Groups, first: dict[int, int], second: dict[int, int]) -> dict[str, object]:
    """T-test of the mean over one set of cells minus that over another.

    `first`, `second`: level of each factor that is not averaged, by its index among between- and within-subject
    factors.
    """
    from scipy.stats import t as t_distribution

    outer = len(groups.levels)
    inside = [_mean_within(y, {i - outer: k for i, k in cell.items() if i >= outer}) for cell in (first, second)]
    weights = [_group_weights(groups, {i: k for i, k in cell.items() if i < outer}) for cell in (first, second)]
    differs_between = bool((weights[0] != weights[1]).any())
    scores = inside[0] if differs_between else inside[0] - inside[1]
    weight = weights[0] - weights[1] if differs_between else weights[0]
    means = groups.means(scores[:, None])[:, 0]
    df = len(scores) - len(groups.sizes)
    spread = float(np.sqrt(((scores - means[groups.number]) ** 2).sum() / df))
    size = float(np.sqrt((weight**2 / groups.sizes).sum()))  # standard error in units of the spread
    difference = float(weight @ means)
    row: dict[str, object] = {"difference": difference, "df": df}
    if spread <= 1e-12 * float(np.abs(y).max()):
        void = dict.fromkeys(("low", "high", "t", "p", "d", "d_low", "d_high"), np.nan)
        return row | void | {"note": "the same difference in every participant: no error to compare it with"}
    t = difference / (spread * size)
    half = float(t_distribution.ppf(0.975, df)) * spread * size
    low, high = noncentral_t_limits(t, df)
    p = float(2 * t_distribution.sf(abs(t), df))
    row |= {"low": difference - half, "high": difference + half, "t": t, "p": p}
    return row | {"d": t * size, "d_low": low * size, "d_high": high * size, "note": ""}


def _correct(rows: list[dict[str, Any]], levels: int) -> None:
    """Add the corrected p-values: Tukey's for a factor with this number of levels, or Holm's if 0."""
    from scipy.stats import studentized_range

    known = [row for row in rows if np.isfinite(row["p"])]
    corrected = (
        [studentized_range.sf(2**0.5 * abs(row["t"]), levels, row["df"]) for row in known]
        if levels
        else holm([row["p"] for row in known])
    )
    for row in rows:
        row |= {"p_pairs": np.nan, "correction": "Tukey" if levels else "Holm"}
    for row, p in zip(known, corrected, strict=True):
        row["p_pairs"] = float(p)


def _mean_within(y: Array, cell: dict[int, int]) -> Array:
    """Mean of each participant over the cells with the given levels of within-subject factors."""
    chosen = y[(slice(None), *(cell.get(axis, slice(None)) for axis in range(y.ndim - 1)))]
    return chosen.reshape(len(y), -1).mean(axis=1)


def _group_weights(groups: Groups, cell: dict[int, int]) -> Array:
    """Weight of each group in the unweighted mean over the groups with the given levels."""
    weights = np.zeros(groups.shape)
    weights[tuple(cell.get(axis, slice(None)) for axis in range(len(groups.shape)))] = 1
    return (weights / weights.sum()).ravel()
