"""Analysis of a study: all findings in the order of the report, with the result of every question of the plan."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from pandas import DataFrame

from midair.errors import InputError
from midair.model.provenance import counted
from midair.progress import report_progress
from midair.study.findings.choice_findings import (
    Choices,
    Finding,
    attempt,
    choice_findings,
    compared,
    confusions,
    interval_words,
)
from midair.study.findings.rating_findings import adaptive, rating_findings, rating_means
from midair.study.findings.study_data import StudyData
from midair.study.statistics.columns import levels
from midair.study.statistics.confusion import limits_over_people
from midair.study.statistics.detection import d_prime_same_different, d_prime_yes_no, two_answers_limits

_UNTESTED = "There is no test, since the planned analyses do not include this question."


def question_findings(data: StudyData) -> list[Finding]:
    """One finding for each question that no other part of the report analyses."""
    found: list[Finding] = []
    for rows, title in ((data.others, "Question {}"), (data.form, "Question {} of the form")):
        for name, answers in [] if rows is None else rows.groupby("question", sort=False):
            one = title.format(name)
            parts = attempt(one, partial(_finding_by_kind, one, answers))
            if rows is data.form:
                tables = [None if part.table is None else part.table.drop(columns="stimulus") for part in parts]
                parts = [replace(part, table=table) for part, table in zip(parts, tables, strict=True)]
            found += parts
    return found


def _finding_by_kind(title: str, rows: DataFrame) -> list[Finding]:
    kind = rows["kind"].iloc[0]
    if kind == "magnitude":
        return [_magnitude_finding(title, rows)]
    if kind in ("rating", "slider"):
        ratings = rows.assign(rating=rows["answer"].astype(float))
        # A mean of each person first: some answer a stimulus more often than others.
        means = ratings.pivot_table(values="rating", index="participant", columns="stimulus", sort=False)
        table = DataFrame({"mean_rating": means.mean(), "sd_people": means.std(), "people": means.count()})
        table = table.assign(given=rows["stimulus"].value_counts()).reset_index()
        own = ratings.pivot_table(values="rating", index="participant")["rating"]
        limits = interval_words(lambda people: limits_over_people(np.mean, people), own.to_numpy(float))
        words = f"Mean {own.mean():.2f} ({limits}), over {len(own)} people and {len(ratings)} answers. {_UNTESTED}"
        return [Finding(title=title, words=words, table=table)]
    judged = kind != "choice" and bool((rows["right"] != "n/a").any())
    return [_detection_finding(title, rows) if judged else _choice_finding(title, rows)]


def _choice_finding(title: str, rows: DataFrame) -> Finding:
    table = rows[["stimulus", "answer"]].value_counts().sort_index().reset_index(name="given")
    right = [answer == known for answer, known in zip(rows["answer"], rows["right"], strict=True) if known != "n/a"]
    words = (
        f"{sum(right)} of {len(right)} answers are correct."
        if right
        else f"{len(rows)} answers; the question has no correct one."
    )
    return Finding(title=title, words=f"{words} {_UNTESTED}", table=table)


def _detection_finding(title: str, rows: DataFrame) -> Finding:
    signal = "yes" if rows["kind"].iloc[0] == "yes-no" else "different"
    # An answer without a correct one is neither a hit nor a false alarm.
    rows = rows.loc[(rows["right"] != "n/a").to_numpy(bool)]
    there, said = ((rows[column] == signal).to_numpy(bool) for column in ("right", "answer"))
    measure = d_prime_yes_no if signal == "yes" else d_prime_same_different
    people, person = levels(rows.loc[:, "participant"])
    by_person = np.stack(
        [np.bincount(person, each, minlength=len(people)) for each in (there & said, there, ~there & said, ~there)], 1
    ).astype(int)
    hits, signals, alarms, blanks = by_person.sum(axis=0).tolist()
    sense = measure(hits, signals, alarms, blanks)
    limits = interval_words(lambda people: two_answers_limits(measure, people), by_person)
    words = (
        f"{hits} of {signals} answered {signal!r} when it was correct, {alarms} of {blanks} when it was wrong:"
        f" d' = {sense.d_prime:.2f} ({limits}), criterion {sense.criterion:.2f}, over all people together."
    )
    return Finding(title=title, words=words)


def _magnitude_finding(title: str, rows: DataFrame) -> Finding:
    value = rows["answer"].to_numpy(float)
    if value.min() <= 0:
        raise InputError(f"magnitudes: expected numbers above 0 for a geometric mean, got {value.min():g}")
    size = rows.assign(mean=np.log(value))
    unit = size.groupby("participant")["mean"].transform("mean")
    size["mean"] += unit[~size["participant"].duplicated()].mean() - unit
    table = size.groupby("stimulus", sort=False, as_index=False).agg(mean=("mean", "mean"))
    table["mean"] = np.exp(table["mean"])
    words = "Geometric means after normalising each person's geometric mean."
    return Finding(title=title, words=words, table=table)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """Result of an analysis."""

    findings: tuple[Finding, ...]
    """Parts in the order of the report."""
    choices: tuple[Choices, ...]
    """Confusion matrices, for the figures."""
    ratings: DataFrame | None
    """Mean rating of each cell with 95 % limits over participants: one column per factor, mean, low, high."""
    simulated: str
    """Mark of simulated answers; empty if there are none."""
    seed: int
    """Seed of the resampling."""


def analyse(data: StudyData, *, seed: int = 0, draws: int = 10_000) -> Report:
    """Run every analysis that the data allow; the report gives the reason for each that cannot be computed.

    `seed` is that of permutations and simulated data, `draws` the number of permutations.
    """
    rng = np.random.default_rng(seed)
    choices, failed = confusions(data)
    findings = [_participants_finding(data), *failed]
    jobs: list[Callable[[], Sequence[Finding]]] = [
        lambda one=one: attempt(f"Identification: {one.name}", lambda: choice_findings(one, rng=rng, draws=draws))
        for one in choices
    ]
    conditions = [] if data.choices is None else data.choices["condition"].map(str).tolist()
    pair = tuple(one for one in choices if one.name in conditions)
    if len(pair) == 2:
        jobs.append(lambda: compared(pair, data, rng=rng))
    if data.ratings is not None:
        jobs.append(lambda: attempt("Ratings: analysis of variance", lambda: rating_findings(data)))
    jobs.append(lambda: question_findings(data))
    jobs.append(lambda: adaptive(data))
    # The order matters: all jobs use the same random generator.
    for job in report_progress(jobs, len(jobs)):
        findings += job()
    return Report(
        findings=tuple(findings), choices=choices, ratings=rating_means(data), simulated=data.simulated, seed=seed
    )


def _participants_finding(data: StudyData) -> Finding:
    known = None if data.thresholds is None else data.thresholds.loc[data.thresholds["threshold"].notna()]
    parts = [data.choices, data.other_choices, data.ratings, data.others, known]
    people = {who for part in parts if part is not None for who in part["participant"].tolist()}
    answers = [data.choices, data.other_choices, data.ratings, data.others]
    many = sum(len(part) for part in answers if part is not None) if data.analysed is None else data.analysed
    left = f", {data.left_out} answers left out (familiarisation, checks, exclusions by the plan)"
    words = f"{counted(len(people), 'participant')}, {many} answers analysed{left if data.left_out else ''}."
    words = " ".join([words, *data.notes])
    if data.excluded is not None:
        out = sorted(set(data.excluded["participant"].tolist()))
        words += f" The plan excludes {', '.join(out)}." if out else " The plan excludes no participant."
    if len(people) < 2:
        words += " With one person there are no limits and no tests over people."
    elif len(people) < 5:
        words += " With fewer than five people there are no limits over people: their coverage would be below 95 %."
    title = (f"{data.simulated}. " if data.simulated else "") + words
    excluded = data.excluded if data.excluded is not None and len(data.excluded) else None
    return Finding(title="Participants", words=title, table=excluded)
