"""What is said about ratings, and about answers to questions other than choices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from midair.errors import InputError
from midair.study.findings.finding import Finding, attempt, p_words
from midair.study.findings.study_data import StudyData
from midair.study.statistics import (
    cell_means,
    d_prime_same_different,
    d_prime_yes_no,
    holm,
    ordinal_check,
    rm_anova,
)

if TYPE_CHECKING:
    from pandas import DataFrame


def anova(data: StudyData) -> list[Finding]:
    """Analysis of variance of the ratings."""
    from pandas import Series

    if data.ratings is None:
        return []
    table = rm_anova(data.ratings, value="rating", participant="participant", within=data.within)
    known = table["p_GG"].dropna()
    table["p_Holm"] = Series(holm(known.to_numpy()), known.index)
    below = table[table["p_Holm"] < 0.05]
    small = [f"{effect} ({p_words(p)})" for effect, p in zip(below["effect"], below["p_Holm"], strict=True)]
    found = f"Ratings depend on {', '.join(small)}." if small else "No effect on the ratings was found."
    words = (
        f"{found} p-values with Greenhouse and Geisser's correction, and Holm's for {len(known)} effects. The"
        " test takes the steps of the scale as equal; the check on ranks does not. No effect found is not no effect."
    )
    return [Finding(title="Ratings: analysis of variance", words=words, table=table)]


def ranks(data: StudyData, *, rng: np.random.Generator) -> list[Finding]:
    """The same on ranks."""
    if data.ratings is None:
        return []
    table = ordinal_check(data.ratings, value="rating", participant="participant", within=data.within, rng=rng)
    small = table["effect"][table["p_sign"] < 0.05].tolist()
    words = (
        f"On each person's ranks, by turning signs and before any correction for the number of effects, p is below .05"
        f" for: {', '.join(small) or 'no effect'}. Where this differs from the analysis of variance, trust neither."
    )
    return [Finding(title="Ratings: check on ranks", words=words, table=table)]


def other_questions(others: DataFrame) -> list[Finding]:
    """Yes-no, same-different and magnitude questions."""
    found: list[Finding] = []
    for name, rows in others.groupby("question", sort=False):
        make = _magnitudes if rows["kind"].iloc[0] == "magnitude" else _detected
        found += attempt(f"Question {name}", lambda rows=rows, name=name, make=make: [make(str(name), rows)])
    return found


def _detected(name: str, rows: DataFrame) -> Finding:
    signal = "yes" if rows["kind"].iloc[0] == "yes-no" else "different"
    there, said = ((rows[name] == signal).to_numpy(bool) for name in ("right", "answer"))
    measure = d_prime_yes_no if signal == "yes" else d_prime_same_different
    hits, alarms = int((there & said).sum()), int((~there & said).sum())
    sense = measure(hits, int(there.sum()), alarms, int((~there).sum()))
    words = (
        f"{hits} of {there.sum()} answered {signal!r} when it was right, {alarms} of {(~there).sum()} when it was"
        f" wrong: d' = {sense.d_prime:.2f}, criterion {sense.criterion:.2f}, over all people together."
    )
    return Finding(title=f"Question {name}", words=words)


def _magnitudes(name: str, rows: DataFrame) -> Finding:
    value = rows["answer"].to_numpy(float)
    if value.min() <= 0:
        raise InputError(f"magnitudes: expected numbers above 0 for a geometric mean, got {value.min():g}")
    size = rows.assign(mean=np.log(value))
    unit = size.groupby("participant")["mean"].transform("mean")
    size["mean"] += unit[~size["participant"].duplicated()].mean() - unit
    table = size.groupby("stimulus", sort=False, as_index=False).agg(mean=("mean", "mean"))
    table["mean"] = np.exp(table["mean"])
    words = "Geometric means after every person's unit was taken out."
    return Finding(title=f"Question {name}", words=words, table=table)


def rating_means(data: StudyData) -> DataFrame | None:
    """Means and limits with each person's own level taken out (Cousineau and Morey), for the figure."""
    if data.ratings is None:
        return None
    try:
        cells = cell_means(data.ratings, value="rating", participant="participant", within=data.within)
    except InputError:
        return None
    from pandas import DataFrame
    from scipy.stats import t as t_distribution

    people = len(cells.participants)
    y = cells.mean.reshape(people, -1)
    centred = y - y.mean(axis=1, keepdims=True) + y.mean()
    half = np.zeros(y.shape[1])
    if people > 1:
        size = y.shape[1] / (y.shape[1] - 1)
        half = t_distribution.ppf(0.975, people - 1) * np.sqrt(size * centred.var(axis=0, ddof=1) / people)
    where = np.indices(cells.mean.shape[1:]).reshape(len(data.within), -1)
    columns = {name: [str(cells.levels[f][i]) for i in where[f]] for f, name in enumerate(data.within)}
    mean = y.mean(axis=0)
    return DataFrame({**columns, "mean": mean, "low": mean - half, "high": mean + half})
