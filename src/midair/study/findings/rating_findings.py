"""What is said about ratings, and about answers to questions other than choices."""

import numpy as np

from midair.errors import InputError
from midair.study.findings.finding import Finding, attempt, p_words
from midair.study.findings.study_data import StudyData
from midair.study.statistics import (
    Table,
    cell_means,
    d_prime_same_different,
    d_prime_yes_no,
    holm,
    levels,
    ordinal_check,
    rm_anova,
)


def anova(data: StudyData) -> list[Finding]:
    """Analysis of variance of the ratings."""
    if data.ratings is None:
        return []
    table = rm_anova(data.ratings, value="rating", participant="participant", within=data.within)
    p = table["p_GG"]
    known = np.isfinite(p)
    corrected = np.full(len(p), np.nan)
    corrected[known] = holm(p[known])
    table = Table({**table, "p_Holm": corrected})
    small = [f"{row['effect']} ({p_words(row['p_Holm'])})" for row in table.rows if row["p_Holm"] < 0.05]
    found = f"Ratings depend on {', '.join(small)}." if small else "No effect on the ratings was found."
    words = (
        f"{found} p-values with Greenhouse and Geisser's correction, and Holm's for {int(known.sum())} effects. The"
        " test takes the steps of the scale as equal; the check on ranks does not. No effect found is not no effect."
    )
    return [Finding(title="Ratings: analysis of variance", words=words, table=table)]


def ranks(data: StudyData, *, rng: np.random.Generator) -> list[Finding]:
    """The same on ranks."""
    if data.ratings is None:
        return []
    table = ordinal_check(data.ratings, value="rating", participant="participant", within=data.within, rng=rng)
    small = [str(row["effect"]) for row in table.rows if row["p_sign"] < 0.05]
    words = (
        f"On each person's ranks, by turning signs and before any correction for the number of effects, p is below .05"
        f" for: {', '.join(small) or 'no effect'}. Where this differs from the analysis of variance, trust neither."
    )
    return [Finding(title="Ratings: check on ranks", words=words, table=table)]


def other_questions(others: Table) -> list[Finding]:
    """Yes-no, same-different and magnitude questions."""
    found: list[Finding] = []
    for name in levels(others["question"])[0]:
        rows = others.where({"question": name})
        make = _magnitudes if rows["kind"][0] == "magnitude" else _detected
        found += attempt(f"Question {name}", lambda rows=rows, name=name, make=make: [make(str(name), rows)])
    return found


def _detected(name: str, rows: Table) -> Finding:
    signal = "yes" if rows["kind"][0] == "yes-no" else "different"
    there, said = rows["right"] == signal, rows["answer"] == signal
    measure = d_prime_yes_no if signal == "yes" else d_prime_same_different
    hits, alarms = int((there & said).sum()), int((~there & said).sum())
    sense = measure(hits, int(there.sum()), alarms, int((~there).sum()))
    words = (
        f"{hits} of {there.sum()} answered {signal!r} when it was right, {alarms} of {(~there).sum()} when it was"
        f" wrong: d' = {sense.d_prime:.2f}, criterion {sense.criterion:.2f}, over all people together."
    )
    return Finding(title=f"Question {name}", words=words)


def _magnitudes(name: str, rows: Table) -> Finding:
    value = rows["answer"].astype(float)
    if value.min() <= 0:
        raise InputError(f"magnitudes: expected numbers above 0 for a geometric mean, got {value.min():g}")
    stimuli, which = levels(rows["stimulus"])
    people, person = levels(rows["participant"])
    unit = np.array([np.log(value[person == i]).mean() for i in range(len(people))])
    adjusted = np.exp(np.log(value) - unit[person] + unit.mean())
    mean = [float(np.exp(np.log(adjusted[which == i]).mean())) for i in range(len(stimuli))]
    words = "Geometric means after every person's unit was taken out."
    return Finding(
        title=f"Question {name}", words=words, table=Table({"stimulus": np.array(stimuli), "mean": np.array(mean)})
    )


def rating_means(data: StudyData) -> Table | None:
    """Means and limits with each person's own level taken out (Cousineau and Morey), for the figure."""
    if data.ratings is None:
        return None
    try:
        cells = cell_means(data.ratings, value="rating", participant="participant", within=data.within)
    except InputError:
        return None
    from scipy.stats import t as t_distribution

    people = len(cells.participants)
    y = cells.mean.reshape(people, -1)
    centred = y - y.mean(axis=1, keepdims=True) + y.mean()
    half = np.zeros(y.shape[1])
    if people > 1:
        size = y.shape[1] / (y.shape[1] - 1)
        half = t_distribution.ppf(0.975, people - 1) * np.sqrt(size * centred.var(axis=0, ddof=1) / people)
    where = np.indices(cells.mean.shape[1:]).reshape(len(data.within), -1)
    columns = {name: np.array([str(cells.levels[f][i]) for i in where[f]]) for f, name in enumerate(data.within)}
    mean = y.mean(axis=0)
    return Table({**columns, "mean": mean, "low": mean - half, "high": mean + half})
