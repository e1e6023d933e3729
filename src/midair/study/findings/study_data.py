"""Input of an analysis: choices, ratings and other answers, independent of their origin."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame, Series

from midair.errors import InputError
from midair.study.design.study_design import Analysis, Design
from midair.study.statistics.columns import BLANK, any_column, column, frame_of, is_blank, typed
from midair.validation import is_number

_SINGLE = ("yes-no", "same-different", "magnitude")
"""Kinds of questions that always get their own part of the report."""


NO_PERSON = "SIMULATED: no person was asked"
NO_TOUCH = "SIMULATED array: nothing could be felt"


def simulation_of(answers: DataFrame) -> str:
    """Mark of the simulated answers of a table: those of a model, or of people on a simulated array; empty if none."""
    if "simulated" not in answers:
        return ""
    marked = (answers["simulated"].astype(str).str.lower() == "true").to_numpy(bool)
    model = (answers["reaction_by"] == "model").to_numpy(bool) if "reaction_by" in answers else marked
    return NO_TOUCH if (marked & ~model).any() else NO_PERSON if marked.any() else ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyData:
    """Answers prepared for `analyse`."""

    choices: DataFrame | None = None
    """Columns participant, presented, answered, condition ("all" without conditions); one row per trial."""
    other_choices: DataFrame | None = None
    """As `choices` for trials outside the comparison, such as those with real objects, with one condition name."""
    ratings: DataFrame | None = None
    """Columns participant, rating and one per factor of `within`."""
    within: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    """Factors between people, which the R script tests."""
    excluded: DataFrame | None = None
    """Participants excluded by the plan, see `left_out`: columns participant, rule, value, limit."""
    others: DataFrame | None = None
    """Answers to yes-no, same-different and magnitude questions and all answers outside `choices` and `ratings`, except
    texts: columns participant, question, kind, stimulus, answer, right."""
    form: DataFrame | None = None
    """Answers to the form of analysed participants, with the same columns."""
    thresholds: DataFrame | None = None
    """Thresholds of each participant, see `thresholds_of`."""
    margin: float = 0.1
    """Equivalence margin of the difference of macro F."""
    options: tuple[str, ...] = ()
    """Possible answers of the identification; those that were given if empty."""
    analysed: int | None = None
    """Number of answers in any part of the report; None counts those of all parts."""
    simulated: str = ""
    """Mark of simulated answers, see `simulation_of`; empty if there are none."""
    left_out: int = 0
    """Number of answers that are not analysed: familiarisation, and exclusions by the plan."""
    notes: tuple[str, ...] = ()
    """Sentences on consent and stops; of an imported table on rows that are left out or may be counted twice."""


def data_of_answers(
    answers: DataFrame,
    analysis: Analysis,
    *,
    thresholds: DataFrame | None = None,
    excluded: DataFrame | None = None,
    design: Design | None = None,
) -> StudyData:
    """Sort the answers of a study (`answers_table`) by the planned analyses.

    `thresholds` is the result of `thresholds_of`, `excluded` that of `excluded_participants`; `design` gives the
    form. Raises InputError if no answer is scored.
    """
    scored = answers if answers.empty else answers.loc[answers["scored"].to_numpy(bool)]
    if scored.empty:
        rules = Counter(answers["excluded"].tolist() if "excluded" in answers else [])
        why = ", ".join(f"{many} by the rule '{rule}'" for rule, many in rules.items() if rule != "n/a")
        next_step = f"the plan excludes {why}" if why else "run a participant first"
        raise InputError(f"answers: expected scored answers, got none among {len(answers)}; {next_step}")
    counts = np.ones(len(scored), bool)
    for factor, level in analysis.only.items():
        counts &= (scored[factor] == level).to_numpy(bool)
    asked = (scored["question"] == analysis.choice).to_numpy(bool)
    rated = scored.loc[scored["question"].isin(analysis.rated) & counts]
    named = asked & (scored["right"] != "n/a").to_numpy(bool) if "right" in scored else asked
    single = scored["kind"].isin(_SINGLE).to_numpy(bool)
    listed = scored["question"].isin(analysis.rated).to_numpy(bool) & counts
    rest = scored.loc[(single | ~(named | listed)) & (scored["kind"] != "text").to_numpy(bool)]
    form = _form_rows(scored, design)
    return StudyData(
        choices=_choices(scored.loc[asked & counts], analysis.condition),
        other_choices=_other_choices(scored.loc[asked & ~counts], analysis),
        ratings=_ratings(rated, value="answer", factors=analysis.within) if len(rated) else None,
        within=analysis.within,
        between=analysis.between,
        excluded=excluded,
        others=rest if len(rest) else None,
        form=form if len(form) else None,
        thresholds=thresholds,
        margin=analysis.margin,
        options=design.question(analysis.choice).options if design is not None and analysis.choice else (),
        analysed=int((named | listed | (scored["kind"] != "text").to_numpy(bool)).sum()),
        simulated=simulation_of(scored),
        left_out=len(answers) - len(scored),
    )


def data_of_columns(
    table: DataFrame | Mapping[str, Any],
    *,
    participant: str,
    presented: str = "",
    answered: str = "",
    condition: str = "",
    rating: str = "",
    within: Sequence[str] = (),
    margin: float = 0.1,
    simulated: str = "",
    where: Sequence[tuple[str, str]] = (),
) -> StudyData:
    """Answers from the named columns of any table, such as the data of another program or of earlier studies.

    `where` names columns and the value that a row must have in each to be used. Rows without a value in a named column
    are no trials and are left out; `StudyData.notes` states how many. The other options are those of `Analysis`. Raises
    InputError if a column is missing, no row is left, or neither choices nor ratings are named.
    """
    data = frame_of(table)
    notes: list[str] = []
    for name, value in where:
        unlike = f"{name} is not {value!r}" if value else f"{name} is not empty"
        data = _kept_rows(data, _equals(any_column(data, name), value), unlike, notes)
    choices = ratings = None
    if presented and answered:
        named = (participant, presented, answered, *([condition] if condition else []))
        rows = _filled_rows(data, named, notes, presented=presented)
        texts = [name for name in (presented, answered) if all(isinstance(label, str) for label in rows[name])]
        numbers = {name: typed(rows.loc[:, name]) for name in texts}
        # Without the empty fields all labels may be numbers.
        if all(labels.dtype == float for labels in numbers.values()):
            rows = rows.assign(**numbers)
        choices = _choices(rows, condition, participant=participant, presented=presented, answered=answered)
        _note_doubles(rows, participant, notes)
    if rating:
        if not within:
            raise InputError("ratings: expected the factors of the analysis of variance (`within`), got none")
        rows = _filled_rows(data, (participant, rating, *within), notes)
        ratings = _ratings(rows, participant=participant, value=rating, factors=within)
        _note_doubles(rows, participant, notes)
    if choices is None and ratings is None:
        raise InputError("columns: expected `presented` and `answered`, or `rating` and `within`, got neither")
    return StudyData(
        choices=choices,
        ratings=ratings,
        within=tuple(within),
        margin=margin,
        simulated=simulated,
        notes=tuple(dict.fromkeys(notes)),
    )


def _equals(values: Series, text: str) -> NDArray[np.bool_]:
    """Whether each value is that of this field of a table."""
    if text in BLANK:
        return is_blank(values)
    if values.dtype == bool:
        return (values.astype(str) == text.capitalize()).to_numpy(bool)
    number = values.dtype.kind in "if" and is_number(text)
    return (values == float(text) if number else values.astype(str) == text).to_numpy(bool)


def _filled_rows(data: DataFrame, names: Sequence[str], notes: list[str], *, presented: str = "") -> DataFrame:
    """Rows with a value in each of these columns: other programs write rows for instructions, breaks and loops."""
    for name in names:
        values = any_column(data, name)
        # An answer None, as PsychoPy writes it, came too late; a thing that was presented has a name.
        blank = is_blank(values) | (values.astype(str) == "None").to_numpy(bool) & (name == presented)
        data = _kept_rows(data, ~blank, f"{name} is empty", notes)
    return data


def _kept_rows(data: DataFrame, kept: NDArray[np.bool_], unlike: str, notes: list[str]) -> DataFrame:
    if not kept.any():
        raise InputError(f"table: expected rows to analyse, got none: in all {len(data)} rows {unlike}")
    if not kept.all():
        notes.append(f"{np.count_nonzero(~kept)} of {len(data)} rows are left out, since {unlike} there.")
    return data.loc[kept]


def _note_doubles(rows: DataFrame, participant: str, notes: list[str]) -> None:
    """Note rows that are equal in every column, and names of people that differ in zeros, capitals or spaces."""
    if double := int(rows.duplicated().sum()):
        notes.append(
            f"{double} of {len(rows)} rows equal an earlier row in every column; remove them if they are copies."
        )
    people: dict[str, list[str]] = {}
    for name in map(str, rows[participant].unique().tolist()):
        people.setdefault(re.sub(r"(?<!\d)0+(?=\d)", "", "".join(name.casefold().split())), []).append(name)
    for names in people.values():
        if len(names) > 1:
            listed = " and ".join(map(repr, names))
            notes.append(f"{listed} are counted as {len(names)} people; spell each person in one way.")


def _choices(
    rows: DataFrame,
    condition: str,
    *,
    participant: str = "participant",
    presented: str = "right",
    answered: str = "answer",
) -> DataFrame | None:
    # Trials without a correct answer are catch trials or attention checks.
    rows = rows.loc[(rows["right"] != "n/a").to_numpy(bool)] if presented == "right" and len(rows) else rows
    if rows.empty:
        return None
    names = {"participant": participant, "presented": presented, "answered": answered}
    found = DataFrame({name: column(rows, given) for name, given in names.items()})
    _check_labels(found, presented, answered)
    return found.assign(condition=column(rows, condition) if condition else "all")


def _check_labels(found: DataFrame, presented: str, answered: str) -> None:
    """Raise InputError if labels are numbers in one column and text in the other: they would never match."""
    given = {presented: found["presented"].tolist(), answered: found["answered"].tolist()}
    words = {name: [label for label in labels if isinstance(label, str)] for name, labels in given.items()}
    mixed = [name for name in given if words[name]]
    if not mixed or all(len(words[name]) == len(given[name]) for name in given):
        return
    name = mixed[-1]
    odd = next((word for word in words[name] if not is_number(word)), words[name][0])
    raise InputError(
        f"column {name!r}: expected labels of one kind in {presented!r} and {answered!r}, got {odd!r} where the other "
        "column has numbers; remove or rename the rows without an answer"
    )


def _form_rows(scored: DataFrame, design: Design | None) -> DataFrame:
    """One row per participant and question of the form, without private and text questions."""
    people = scored.drop_duplicates("participant")
    rows = [
        {"participant": who, "question": name, "kind": design.question(name).kind, "answer": answer}
        for name in (() if design is None else design.form)
        if design is not None and name in people
        for who, answer in zip(people["participant"], people[name], strict=True)
        if answer != "n/a" and design.question(name).kind != "text"
    ]
    table = DataFrame(rows, columns=["participant", "question", "kind", "answer"])
    return table.assign(stimulus="the form", right="n/a")


def _other_choices(rows: DataFrame, analysis: Analysis) -> DataFrame | None:
    """Choices outside the comparison, named by the level that they share of the selecting factors."""
    choices = _choices(rows, "")
    shared = [rows[factor].unique().tolist() for factor in analysis.only]
    name = ", ".join(str(found[0]) for found in shared if len(found) == 1) or "other trials"
    return None if choices is None else choices.assign(condition=name)


def _ratings(rows: DataFrame, *, value: str, factors: Sequence[str], participant: str = "participant") -> DataFrame:
    given = column(rows, value)
    try:
        rating = given.astype(float)
    except (TypeError, ValueError) as wrong:
        raise InputError(f"column {value!r}: expected ratings, got {given[:3].tolist()}") from wrong
    found = {name: column(rows, name) for name in factors}
    return DataFrame({"participant": column(rows, participant), "rating": rating} | found)
