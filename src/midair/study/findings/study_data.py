"""What an analysis works on: choices, ratings and other answers, apart from how they were collected."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from midair.errors import InputError
from midair.study.design import Analysis
from midair.study.statistics import Columns, Table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyData:
    """Answers ready for `analyse`.

    Attributes
    ----------
    choices : Table or None
        Columns participant, presented, answered, condition (one word if there are no conditions), one row a trial.
    other_choices : Table or None
        The same for trials outside the comparison, such as those with real objects; their condition names them.
    ratings : Table or None
        Columns participant, rating and one a factor of `within`.
    within : tuple of str
        Factors of the ratings.
    others : Table or None
        Answers to yes-no, same-different and magnitude questions: columns participant, question, kind, answer, right.
    strengths : Table or None
        Columns participant, level, correct (0 or 1), guess: answers to stimuli of a known strength.
    thresholds : Table or None
        Columns participant, block, threshold, sd, note: of adaptive blocks.
    margin : float
        Difference of macro F that does not matter.
    simulated : bool
        Whether any answer comes from a simulated participant.
    left_out : int
        Answers that were not analysed: familiarisation.
    """

    choices: Table | None = None
    other_choices: Table | None = None
    ratings: Table | None = None
    within: tuple[str, ...] = ()
    others: Table | None = None
    strengths: Table | None = None
    thresholds: Table | None = None
    margin: float = 0.1
    simulated: bool = False
    left_out: int = 0


def data_of_answers(answers: Table, analysis: Analysis, *, thresholds: Table | None = None) -> StudyData:
    """Sort the answers of a study by what its design says will be tested.

    Parameters
    ----------
    answers : Table
        As `answers_table` makes it.
    analysis : Analysis
        Of the design.
    thresholds : Table, optional
        Of adaptive blocks, see `thresholds_of`.

    Raises
    ------
    InputError
        If no answer is scored.
    """
    scored = answers.take(answers["scored"].astype(bool)) if answers.height else answers
    if not scored.height:
        raise InputError("answers: expected some that are scored, got none; run a participant first")
    counts = np.ones(scored.height, bool)
    for factor, level in analysis.only.items():
        counts &= scored[factor] == level
    asked = scored["question"] == analysis.choice
    rated = scored.take(np.isin(scored["question"], analysis.rated) & counts)
    rest = scored.take(np.isin(scored["kind"], ("yes-no", "same-different", "magnitude")))
    return StudyData(
        choices=_choices(scored.take(asked & counts), analysis.condition),
        other_choices=_named(_choices(scored.take(asked & ~counts), ""), scored.take(asked & ~counts), analysis),
        ratings=_ratings(rated, value="answer", within=analysis.within) if rated.height else None,
        within=analysis.within,
        others=rest if rest.height else None,
        strengths=_strengths(scored, analysis) if analysis.strength else None,
        thresholds=thresholds,
        margin=analysis.margin,
        simulated=bool(scored["simulated"].any()),
        left_out=answers.height - scored.height,
    )


def data_of_columns(
    table: Columns,
    *,
    participant: str,
    presented: str = "",
    answered: str = "",
    condition: str = "",
    rating: str = "",
    within: Sequence[str] = (),
    margin: float = 0.1,
    simulated: bool = False,
) -> StudyData:
    """Answers from any table by the names of its columns: old data of a lab.

    Raises
    ------
    InputError
        If a column is not there, or neither choices nor ratings are named.
    """
    data = Table.of(table)
    choices = ratings = None
    if presented and answered:
        names = {"participant": data[participant], "right": data[presented], "answer": data[answered]}
        choices = _choices(Table(names | ({condition: data[condition]} if condition else {})), condition)
    if rating:
        ratings = _ratings(Table({**data, "participant": data[participant]}), value=rating, within=within)
    if choices is None and ratings is None:
        raise InputError("columns: expected `presented` and `answered`, or `rating` and `within`, got neither")
    return StudyData(choices=choices, ratings=ratings, within=tuple(within), margin=margin, simulated=simulated)


def _choices(rows: Table, condition: str) -> Table | None:
    if not rows.height:
        return None
    where = rows[condition] if condition else np.full(rows.height, "all")
    return Table(
        {
            "participant": rows["participant"],
            "presented": rows["right"],
            "answered": rows["answer"],
            "condition": where,
        }
    )


def _named(choices: Table | None, rows: Table, analysis: Analysis) -> Table | None:
    """Choices under the one level that they share of the factors that set them apart."""
    if choices is None:
        return None
    shared = [set(rows[factor].tolist()) for factor in analysis.only]
    name = ", ".join(str(next(iter(found))) for found in shared if len(found) == 1) or "other trials"
    return Table({**choices, "condition": np.full(choices.height, name)})


def _strengths(rows: Table, analysis: Analysis) -> Table | None:
    name = analysis.strength
    known = rows.take((rows[name] != "n/a") & (rows["correct"] >= 0))
    if not known.height:
        return None
    try:
        level = known[name].astype(float)
    except ValueError as wrong:
        raise InputError(f"factor {name!r}: expected strengths as numbers, got {known[name][:3].tolist()}") from wrong
    correct = known["correct"].astype(float)
    guess = np.full(known.height, analysis.guess)
    return Table({"participant": known["participant"], "level": level, "correct": correct, "guess": guess})


def _ratings(rows: Table, *, value: str, within: Sequence[str]) -> Table:
    if not within:
        raise InputError("ratings: expected the factors of the analysis of variance (`within`), got none")
    try:
        rating = rows[value].astype(float)
    except (TypeError, ValueError) as wrong:
        raise InputError(f"column {value!r}: expected ratings, got {rows[value][:3].tolist()}") from wrong
    return Table({"participant": rows["participant"], "rating": rating} | {name: rows[name] for name in within})
