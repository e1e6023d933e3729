"""Report on ratings, and on the thresholds of each participant."""

from collections import Counter

import numpy as np
import scipy
from numpy.typing import NDArray
from pandas import DataFrame, Series

from midair.errors import InputError
from midair.study.findings.choice_findings import Finding, p_words
from midair.study.findings.study_data import StudyData
from midair.study.statistics.anova import rm_anova
from midair.study.statistics.columns import cell_means
from midair.study.statistics.paired import holm, order_rank, pairwise


def complete_ratings(data: StudyData) -> tuple[DataFrame, str]:
    """Ratings of participants with an answer in every cell, and a sentence on the others."""
    ratings = data.ratings
    if ratings is None:
        raise InputError("ratings: expected a table of ratings, got none")
    filled = ratings.drop_duplicates(["participant", *data.within])
    cells = len(filled.drop_duplicates(list(data.within)))
    many = Counter(filled["participant"].tolist())
    short = {who: count for who, count in many.items() if count < cells}
    if not short:
        return ratings, ""
    named = ", ".join(f"{who} ({count} of {cells} cells)" for who, count in short.items())
    rest = ratings.loc[~ratings["participant"].isin(list(short))]
    if rest.empty:
        raise InputError(f"ratings: expected a participant with an answer in every cell, got none: {named}")
    return rest, f" Left out, because cells have no answer: {named}."


def rating_findings(data: StudyData) -> list[Finding]:
    """Analysis of variance of the ratings, its sphericity statistics, and pairwise comparisons."""
    ratings, left_out = complete_ratings(data)
    table = rm_anova(ratings, value="rating", participant="participant", within=data.within)
    known = table["p_GG"].dropna()
    table["p_Holm"] = Series(holm(known.to_numpy()), known.index)
    below = table[table["p_Holm"] < 0.05]
    small = [f"{effect} ({p_words(p)})" for effect, p in zip(below["effect"], below["p_Holm"], strict=True)]
    none = "No effect on the ratings was found." if len(known) else "No effect could be tested."
    found = f"Ratings depend on {', '.join(small)}." if small else none
    void = table.loc[table["p_GG"].isna(), "effect"].tolist()
    if void:
        found += f" Not testable, see the notes: {', '.join(void)}."
    words = (
        f"{found} p-values with Greenhouse and Geisser's correction, and Holm's for {len(known)} effects,"
        f" {len(set(ratings['participant']))} people. The test assumes equal steps of the scale; the"
        f" cumulative-link model of the exported R script does not. A missing effect is no proof of none.{left_out}"
    )
    if data.between:
        words += f" Factors between people ({', '.join(data.between)}) are tested by the R script only."
    main = DataFrame(table, columns=["effect", "df1", "df2", "F", "p_GG", "p_Holm", "np2", "ges", "note"])
    several = DataFrame(table.loc[table["df1"] > 1], columns=["effect", "eps_GG", "eps_HF", "p", "p_HF", "W", "p_W"])
    findings = [Finding(title="Ratings: analysis of variance", words=words, table=main)]
    if len(several):
        words = (
            "The F-test of an effect with more than one contrast assumes sphericity. Epsilon measures the violation; p"
            " is uncorrected, p_HF has the less strict correction of Huynh and Feldt."
        )
        findings.append(Finding(title="Ratings: sphericity", words=words, table=several))
    interactions = [effect for effect in below["effect"].tolist() if effect.count(":") == 1]
    return [*findings, _pairs(ratings, data.within, interactions)]


def _pairs(ratings: DataFrame, within: tuple[str, ...], interactions: list[str]) -> Finding:
    """Pairwise comparisons of the levels of each factor, and of the cells of two-way interactions that were found."""
    effects = [*within, *interactions]
    table = pairwise(ratings, value="rating", participant="participant", within=within, effects=effects)
    tested = np.count_nonzero(table["p_pairs"].notna())
    words = (
        f"{np.count_nonzero(table['p_pairs'] < 0.05)} of {tested} pairs differ. Each pair is compared by t; p_pairs"
        " is corrected for the pairs of the same effect, by Holm's method, not for the number of effects: the analysis"
        " of variance is. Limits are not corrected."
    )
    if interactions:
        words += f" For {', '.join(interactions)}: the pairs of cells that differ in one factor."
    return Finding(title="Ratings: pairwise comparisons", words=words, table=table)


def rating_means(data: StudyData) -> DataFrame | None:
    """Cell means with within-subject 95 % limits (Cousineau and Morey), for the figure."""
    if data.ratings is None:
        return None
    try:
        cells = cell_means(complete_ratings(data)[0], value="rating", participant="participant", within=data.within)
    except InputError:
        return None
    people = len(cells.participants)
    y = cells.mean.reshape(people, -1)
    centred = y - y.mean(axis=1, keepdims=True) + y.mean()
    half = np.zeros(y.shape[1])
    if people > 1:
        size = y.shape[1] / (y.shape[1] - 1)
        half = scipy.stats.t.ppf(0.975, people - 1) * np.sqrt(size * centred.var(axis=0, ddof=1) / people)
    where = np.indices(cells.mean.shape[1:]).reshape(len(data.within), -1)
    columns = {name: [str(cells.levels[f][i]) for i in where[f]] for f, name in enumerate(data.within)}
    mean = y.mean(axis=0)
    return DataFrame({**columns, "mean": mean, "low": mean - half, "high": mean + half})


def adaptive(data: StudyData) -> list[Finding]:
    """Thresholds of each participant, and their median over participants with those beyond the levels."""
    if data.thresholds is None:
        return []
    known = data.thresholds.loc[data.thresholds["threshold"].notna()]
    several = len(set(data.thresholds["block"])) > 1
    parts: list[str] = []
    # Blocks may have different strengths, and their thresholds are not those of different people.
    for block, rows in known.groupby("block", sort=False):
        words = _median_words(rows["threshold"].to_numpy(float), float(rows["strongest"].iloc[0]))
        parts.append(f"Block {block}: {words}" if several else f"{words[0].upper()}{words[1:]}")
    words = " ".join(parts) or "No threshold could be estimated."
    if len(known) < len(data.thresholds):
        words += f" {len(data.thresholds) - len(known)} missing: the notes give the reasons."
    words += (
        " Each threshold is the level at half of the rise of a logistic function of the logarithm of the level (75 %"
        " correct answers of two, without lapses), fitted by maximum likelihood; slope, lapse rate and, for yes and no,"
        " the false-alarm rate are fitted too."
    )
    title = "Thresholds" if "constant" in set(data.thresholds["method"]) else "Thresholds of adaptive blocks"
    return [Finding(title=title, words=words, table=data.thresholds)]


def _median_words(values: NDArray[np.float64], strongest: float) -> str:
    """Median of thresholds, which counts those beyond the levels, with limits by order statistics.

    Estimates close to the strongest level are too low, so that limits above a third of it do not hold
    (docs/decisions/0036-thresholds.md).
    """
    ordered, many = np.sort(values), len(values)
    low, high = ordered[(many - 1) // 2], ordered[many // 2]
    middle = float(np.sqrt(low * high)) if np.isfinite(low + high) else low + high
    outside = order_rank(many)
    if not outside:
        limits = f"no limits with fewer than six people, got {many}"
    elif ordered[outside - 1] > strongest / 3:
        limits = f"no limits, since thresholds close to the strongest level {strongest:g} are estimated too low"
    else:
        limits = f"95 % limits over people {_level(ordered[outside - 1])} to {_level(ordered[-outside])}"
    words = f"median of {many} thresholds: {_level(middle)} ({limits})."
    above, below = np.count_nonzero(values == np.inf), np.count_nonzero(values == -np.inf)
    beyond = " and ".join(f"{n} {side}" for n, side in ((above, "above"), (below, "below")) if n)
    return words + (f" The median includes people beyond the levels: {beyond}." if beyond else "")


def _level(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "above the levels" if value > 0 else "below the levels"
