"""Report on every question of the plan: its result, or the reason why it has none."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from midair.errors import InputError
from midair.study.findings.finding import Finding, attempt, interval_words, limits_words
from midair.study.statistics import d_prime_same_different, d_prime_yes_no, levels, two_answers_limits

if TYPE_CHECKING:
    from pandas import DataFrame

    from midair.study.findings.study_data import StudyData

_UNTESTED = "There is no test, since the planned analyses do not include this question."


def question_findings(data: StudyData) -> list[Finding]:
    """One finding for each question that no other part of the report analyses."""
    found: list[Finding] = []
    for rows, title in ((data.others, "Question {}"), (data.form, "Question {} of the form")):
        for name, answers in [] if rows is None else rows.groupby("question", sort=False):
            one = title.format(name)
            parts = attempt(one, partial(_finding_by_kind, one, answers))
            found += parts if rows is data.others else [_without_stimulus(part) for part in parts]
    return found


def _without_stimulus(part: Finding) -> Finding:
    """The finding without the column "stimulus", for questions of the form."""
    return part if part.table is None else replace(part, table=part.table.drop(columns="stimulus"))


def every_question(questions: DataFrame) -> Finding:
    """Part of the report that analyses each question of the plan, or the reason why none does."""
    from pandas import DataFrame

    rows = questions.to_dict("records")
    notes = [row["part"] or f"not analysed, because {_reason(row)}" for row in rows]
    silent = [f"{row['question']}: {note}." for row, note in zip(rows, notes, strict=True) if not row["part"]]
    words = " ".join(silent) or "Every question of the plan is analysed; the table names the part of the report."
    table = DataFrame(questions, columns=["question", "text", "kind", "given", "analysed"])
    return Finding(title="Questions of the plan", words=words, table=table.assign(part=notes))


def _reason(row: dict[str, object]) -> str:
    if row["private"]:
        return "it is private: its answers stay in the logs"
    if not row["asked"]:
        return "neither a block nor the form asks it"
    if not row["given"]:
        return "it has no answer"
    if row["kind"] == "text":
        return "its answers are texts; the exported tables contain them"
    if not row["analysed"]:
        return "its answers belong to familiarisation or checks, or the plan excludes them"
    return "no analysis supports it"


def _finding_by_kind(title: str, rows: DataFrame) -> list[Finding]:
    kind = rows["kind"].iloc[0]
    if kind == "magnitude":
        return [_magnitude_finding(title, rows)]
    if kind in ("rating", "slider"):
        from pandas import DataFrame

        rating = np.array(rows["answer"].tolist(), float)
        people, person = levels(rows.loc[:, "participant"])
        stimuli, stimulus = levels(rows.loc[:, "stimulus"])
        shape = (len(people), len(stimuli))
        count, total = np.zeros(shape), np.zeros(shape)
        np.add.at(count, (person, stimulus), 1)
        np.add.at(total, (person, stimulus), rating)
        with np.errstate(invalid="ignore"):
            mean = total / count  # NaN where a person has no answer to a stimulus
        own = total.sum(axis=1) / count.sum(axis=1)
        many = (count > 0).sum(axis=0)
        spread = [np.nanstd(mean[:, i], ddof=1) if many[i] > 1 else np.nan for i in range(len(stimuli))]
        table = DataFrame(
            {
                "stimulus": list(stimuli),
                "mean_rating": np.nanmean(mean, axis=0),
                "sd_people": spread,
                "people": many,
                "given": count.sum(axis=0).astype(int),
            }
        )
        limits = limits_words(lambda people: float(people.mean()), own, "plain")
        words = f"Mean {own.mean():.2f} ({limits}), over {len(own)} people and {len(rating)} answers. {_UNTESTED}"
        return [Finding(title=title, words=words, table=table)]
    judged = kind != "choice" and bool((rows["right"] != "n/a").any())
    return [_detection_finding(title, rows) if judged else _choice_finding(title, rows)]


def _choice_finding(title: str, rows: DataFrame) -> Finding:
    """Counts of each answer to each stimulus."""
    from pandas import DataFrame

    counts = Counter(zip(rows["stimulus"].tolist(), rows["answer"].tolist(), strict=True))
    table = DataFrame(
        [{"stimulus": name, "answer": answer, "given": many} for (name, answer), many in sorted(counts.items())]
    )
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
