"""What an analysis works on: choices, ratings and other answers, apart from how they were collected."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import InputError
from midair.study.statistics import column, frame_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pandas import DataFrame

    from midair.study.design import Analysis, Design, Incomplete, UnpresentedAnswers


_SINGLE = ("yes-no", "same-different", "magnitude")
"""Kinds of questions that have a part of their own, whatever else takes them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyData:
    """Answers ready for `analyse`.

    Attributes
    ----------
    choices : DataFrame or None
        Columns participant, presented, answered, condition (one word if there are no conditions), one row a trial.
    other_choices : DataFrame or None
        The same for trials outside the comparison, such as those with real objects; their condition names them.
    ratings : DataFrame or None
        Columns participant, rating and one a factor of `within`.
    within : tuple of str
        Factors of the ratings within each person.
    between : tuple of str
        Factors of the ratings by which people differ.
    incomplete, foils : str
        What becomes of people without a whole set of ratings, and of answers that name what was never presented: see
        `Analysis`.
    excluded : DataFrame or None
        People whom the rules of the plan leave out, see `left_out`: columns participant, rule, value, limit.
    others : DataFrame or None
        Answers to yes-no, same-different and magnitude questions, and all others that are in neither choices nor
        ratings, but no texts: columns participant, question, kind, stimulus, answer, right.
    form : DataFrame or None
        Answers to the form, of people whose answers count: the same columns.
    questions : DataFrame or None
        Every question of the plan: columns question, kind, private, asked, given and analysed (numbers of answers), and
        part (of the report that analyses it; empty if none does).
    strengths : DataFrame or None
        Columns participant, level, correct (0 or 1), guess: answers to stimuli of a known strength.
    thresholds : DataFrame or None
        Columns participant, block, threshold, sd, note: of adaptive blocks.
    margin : float
        Difference of macro F that does not matter.
    simulated : bool
        Whether any answer comes from a simulated participant.
    left_out : int
        Answers that were not analysed: familiarisation, and those that the rules of the plan leave out.
    files : str
        Result of the check of plan, drives and logs, see `verify_study`; empty for data of tables.
    """

    choices: DataFrame | None = None
    other_choices: DataFrame | None = None
    ratings: DataFrame | None = None
    within: tuple[str, ...] = ()
    between: tuple[str, ...] = ()
    incomplete: Incomplete = "leave out"
    foils: UnpresentedAnswers = "wrong"
    excluded: DataFrame | None = None
    others: DataFrame | None = None
    form: DataFrame | None = None
    questions: DataFrame | None = None
    strengths: DataFrame | None = None
    thresholds: DataFrame | None = None
    margin: float = 0.1
    simulated: bool = False
    left_out: int = 0
    files: str = ""


def data_of_answers(
    answers: DataFrame,
    analysis: Analysis,
    *,
    thresholds: DataFrame | None = None,
    excluded: DataFrame | None = None,
    files: str = "",
    design: Design | None = None,
) -> StudyData:
    """Sort the answers of a study by what its design says will be tested.

    Parameters
    ----------
    answers : DataFrame
        As `answers_table` makes it.
    analysis : Analysis
        Of the design.
    thresholds : DataFrame, optional
        Of adaptive blocks, see `thresholds_of`.
    excluded : DataFrame, optional
        People whom the rules of the plan leave out, see `left_out`.
    files : str
        Result of the check of plan, drives and logs, for the report.
    design : Design, optional
        For the list of all questions, and for those of the form.

    Raises
    ------
    InputError
        If no answer is scored.
    """
    scored = answers if answers.empty else answers.loc[answers["scored"].to_numpy(bool)]
    if scored.empty:
        rules = Counter(answers["excluded"].tolist() if "excluded" in answers else [])
        why = ", ".join(f"{many} by the rule '{rule}'" for rule, many in rules.items() if rule != "n/a")
        next_step = f"the plan leaves out {why}" if why else "run a participant first"
        raise InputError(f"answers: expected some that are scored, got none of {len(answers)}; {next_step}")
    counts = np.ones(len(scored), bool)
    for factor, level in analysis.only.items():
        counts &= (scored[factor] == level).to_numpy(bool)
    asked = (scored["question"] == analysis.choice).to_numpy(bool)
    rated = scored.loc[scored["question"].isin(analysis.rated) & counts]
    named = asked & (scored["right"] != "n/a").to_numpy(bool) if "right" in scored else asked
    single = scored["kind"].isin(_SINGLE).to_numpy(bool)
    listed = scored["question"].isin(analysis.rated).to_numpy(bool) & counts
    rest = scored.loc[(single | ~(named | listed)) & (scored["kind"] != "text").to_numpy(bool)]
    form = _of_form(scored, design)
    parts = {
        "Which object": scored.loc[named],
        "Ratings": rated,
        "Question {}": rest,
        "Question {} of the form": form,
    }
    return StudyData(
        choices=_choices(scored.loc[asked & counts], analysis.condition),
        other_choices=_named(scored.loc[asked & ~counts], analysis),
        ratings=_ratings(rated, value="answer", factors=(*analysis.within, *analysis.between)) if len(rated) else None,
        within=analysis.within,
        between=analysis.between,
        incomplete=analysis.incomplete,
        foils=analysis.foils,
        excluded=excluded,
        others=rest if len(rest) else None,
        form=form if len(form) else None,
        questions=None if design is None else _questions(answers, design, parts),
        strengths=_strengths(scored, analysis) if analysis.strength else None,
        thresholds=thresholds,
        margin=analysis.margin,
        simulated=bool(scored["simulated"].any()),
        left_out=len(answers) - len(scored),
        files=files,
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
    between: Sequence[str] = (),
    incomplete: Incomplete = "leave out",
    foils: UnpresentedAnswers = "wrong",
    margin: float = 0.1,
    simulated: bool = False,
) -> StudyData:
    """Answers from any table by the names of its columns: old data of a lab. The options are those of `Analysis`.

    Raises
    ------
    InputError
        If a column is not there, or neither choices nor ratings are named.
    """
    data = frame_of(table)
    choices = ratings = None
    if presented and answered:
        choices = _choices(data, condition, participant=participant, presented=presented, answered=answered)
    if rating:
        if not within:
            raise InputError("ratings: expected the factors of the analysis of variance (`within`), got none")
        ratings = _ratings(data, participant=participant, value=rating, factors=(*within, *between))
    if choices is None and ratings is None:
        raise InputError("columns: expected `presented` and `answered`, or `rating` and `within`, got neither")
    return StudyData(
        choices=choices,
        ratings=ratings,
        within=tuple(within),
        between=tuple(between),
        incomplete=incomplete,
        foils=foils,
        margin=margin,
        simulated=simulated,
    )


def _choices(
    rows: DataFrame,
    condition: str,
    *,
    participant: str = "participant",
    presented: str = "right",
    answered: str = "answer",
) -> DataFrame | None:
    from pandas import DataFrame

    # Without a right answer nothing was presented that could be named: a catch trial, an attention check.
    rows = rows.loc[(rows["right"] != "n/a").to_numpy(bool)] if presented == "right" and len(rows) else rows
    if rows.empty:
        return None
    names = {"participant": participant, "presented": presented, "answered": answered}
    found = DataFrame({name: column(rows, given) for name, given in names.items()})
    _check_labels(found, presented, answered)
    return found.assign(condition=column(rows, condition) if condition else "all")


def _check_labels(found: DataFrame, presented: str, answered: str) -> None:
    """Raise if one column of labels is numbers and the other is not: such labels are never the same."""
    given = {presented: found["presented"].tolist(), answered: found["answered"].tolist()}
    words = {name: [label for label in labels if isinstance(label, str)] for name, labels in given.items()}
    mixed = [name for name in given if words[name]]
    if not mixed or all(len(words[name]) == len(given[name]) for name in given):
        return
    name = mixed[-1]
    odd = next((word for word in words[name] if not _is_number(word)), words[name][0])
    raise InputError(
        f"column {name!r}: expected labels of one kind in {presented!r} and {answered!r}, got {odd!r} where the other "
        "has numbers; leave out or name what has no answer"
    )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _of_form(scored: DataFrame, design: Design | None) -> DataFrame:
    """Answers to the form as rows, one a participant and question; private ones are in no table."""
    from pandas import DataFrame

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


def _questions(answers: DataFrame, design: Design, parts: Mapping[str, DataFrame]) -> DataFrame:
    """Every question of the plan, how many answers it has, and which parts of a report analyse how many of them."""
    from pandas import DataFrame

    asked = {
        name
        for block in design.blocks
        for names in (block.questions, *(one.questions for one in block.extras))
        for name in names
    }
    counts = {part: Counter(table["question"].tolist()) for part, table in parts.items()}
    given = Counter(answers["question"].tolist())
    rows: list[dict[str, Any]] = []
    for question in design.questions:
        name = question.name
        many = {part.format(name): count[name] for part, count in counts.items()}
        people = answers.drop_duplicates("participant")
        in_form = (
            sum(answer != "n/a" for answer in people[name].tolist()) if name in design.form and name in people else 0
        )
        where = [part for part, number in many.items() if number]
        where += ["factor between people"] if name in design.analysis.between else []
        rows.append(
            {
                "question": name,
                "kind": question.kind,
                "private": question.private,
                "asked": name in asked or name in design.form,
                "given": given[name] + in_form,
                # Answers of one kind may be in two parts.
                "analysed": max(many.values()) if question.kind in _SINGLE else sum(many.values()),
                "part": "; ".join(where),
            }
        )
    return DataFrame(rows)


def _named(rows: DataFrame, analysis: Analysis) -> DataFrame | None:
    """Choices under the one level that they share of the factors that set them apart."""
    choices = _choices(rows, "")
    shared = [rows[factor].unique().tolist() for factor in analysis.only]
    name = ", ".join(str(found[0]) for found in shared if len(found) == 1) or "other trials"
    return None if choices is None else choices.assign(condition=name)


def _strengths(rows: DataFrame, analysis: Analysis) -> DataFrame | None:
    from pandas import DataFrame

    name = analysis.strength
    known = rows.loc[(rows[name] != "n/a") & (rows["correct"] >= 0)]
    if known.empty:
        return None
    try:
        level = known[name].astype(float)
    except ValueError as wrong:
        raise InputError(f"factor {name!r}: expected strengths as numbers, got {known[name][:3].tolist()}") from wrong
    correct = known["correct"].astype(float)
    return DataFrame({"participant": known["participant"], "level": level, "correct": correct, "guess": analysis.guess})


def _ratings(rows: DataFrame, *, value: str, factors: Sequence[str], participant: str = "participant") -> DataFrame:
    from pandas import DataFrame

    given = column(rows, value)
    try:
        rating = given.astype(float)
    except (TypeError, ValueError) as wrong:
        raise InputError(f"column {value!r}: expected ratings, got {given[:3].tolist()}") from wrong
    found = {name: column(rows, name) for name in factors}
    return DataFrame({"participant": column(rows, participant), "rating": rating} | found)
