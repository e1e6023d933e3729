"""Parts of a report, the text of their numbers, and those on choices among objects."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pandas import DataFrame

from midair.errors import InputError
from midair.study.findings.study_data import StudyData
from midair.study.statistics.confusion import (
    Confusion,
    Interval,
    chance_macro_f,
    confusion_matrix,
    scores,
    sign_flip,
)
from midair.study.statistics.detection import d_prime_choice, d_prime_limits, f_limits, macro_f_limits, share_limits
from midair.study.statistics.paired import bayes_factor, equivalence, paired_t


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Finding:
    """One part of a report."""

    title: str
    words: str
    """Result in words."""
    table: DataFrame | None = None
    """Table of the numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choices:
    """Confusion matrix of one condition."""

    name: str
    """Name of the condition."""
    confusion: Confusion
    f_limits: Interval | None
    """Confidence interval of F of each object over participants; None with fewer than five."""


def p_words(p: float) -> str:
    """P-value in the usual format, such as "p < .001" or "p = .030"."""
    return "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".", 1)


def note_last(table: DataFrame) -> DataFrame:
    """The table with the column "note" last."""
    names = [str(name) for name in table.columns if name != "note"]
    return DataFrame(table, columns=[*names, "note"])


def attempt(title: str, make: Callable[[], list[Finding]]) -> list[Finding]:
    """Findings of `make`, or one finding with the reason of its InputError."""
    try:
        return make()
    except InputError as wrong:
        return [Finding(title=title, words=f"Not computed. {str(wrong)[0].upper()}{str(wrong)[1:]}.")]


def interval_words(limits: Callable[[NDArray[Any]], Interval], by_person: NDArray[Any], *, form: str = ".2f") -> str:
    """Confidence interval over participants as text, or the reason why there is none."""
    try:
        found = limits(by_person)
    except InputError as wrong:
        if len(by_person) < 5:
            return f"no limits with fewer than five people, got {len(by_person)}"
        return f"no {wrong}"
    if not np.isfinite(found.low):
        return "no limits, since the differences between people are unknown"
    return f"95 % limits over people {float(found.low):{form}} to {float(found.high):{form}}"


def confusions(data: StudyData) -> tuple[tuple[Choices, ...], list[Finding]]:
    """Confusion matrices of the other trials and of each condition, and findings on those that cannot be computed."""
    parts: list[tuple[str, DataFrame]] = []
    if data.other_choices is not None:
        parts.append((str(data.other_choices["condition"].iloc[0]), data.other_choices))
    if data.choices is not None:
        parts += [(str(name), rows) for name, rows in data.choices.groupby("condition", sort=False)]
    found: list[Choices] = []
    failed: list[Finding] = []
    for name, rows in parts:
        failed += attempt(
            f"Identification: {name}", lambda name=name, rows=rows: found.append(_confusion(name, rows, data)) or []
        )
    return tuple(found), failed


def _confusion(name: str, rows: DataFrame, data: StudyData) -> Choices:
    labels = sorted(set(rows["presented"].tolist()))
    # An option without answers was possible, too: the rate of guesses depends on it.
    foils = sorted({*rows["answered"].tolist(), *data.options} - set(labels))
    presented, answered, people = (rows[name].to_numpy() for name in ("presented", "answered", "participant"))
    confusion = confusion_matrix(presented, answered, participant=people, labels=labels, foils=foils)
    limits = f_limits(confusion.by_person) if len(confusion.participants) >= 5 else None
    return Choices(name=name, confusion=confusion, f_limits=limits)


def choice_findings(one: Choices, *, rng: np.random.Generator, draws: int) -> list[Finding]:
    """Scores, chance level, sensitivity, information and bias of one confusion matrix."""
    confusion, counts = one.confusion, one.confusion.counts
    limits = interval_words(share_limits, confusion.by_person, form=".3f")
    words = [
        f"{100 * confusion.accuracy:.1f} % of {counts.sum()} answers are correct, among {counts.shape[1]} possible"
        f" ones (share {confusion.accuracy:.3f}, {limits})."
    ]
    chosen = counts[:, len(confusion.labels) :].sum(axis=0)
    if chosen.any():
        named = [str(foil) for foil, many in zip(confusion.foils, chosen, strict=True) if many]
        words.append(
            f"{chosen.sum()} answers name an object that was never presented ({', '.join(named)}); they count as wrong."
        )
    wrong = int(counts.sum() - np.trace(counts))
    if 0 < wrong < len(confusion.participants) >= 5:
        words.append(
            "There are fewer wrong answers than people, too few to measure how people differ: the limits are at least"
            " as wide as those of independent answers."
        )
    words = [*words, _chance_words(one.confusion, rng, draws), _sensitivity_words(one.confusion)]
    table = scores(one.confusion).drop(columns=["recall_low", "recall_high"])
    if one.f_limits is not None:
        table = table.assign(F_low=one.f_limits.low, F_high=one.f_limits.high)
    return [Finding(title=f"Identification: {one.name}", words=" ".join(words), table=note_last(table))]


def _chance_words(confusion: Confusion, rng: np.random.Generator, draws: int) -> str:
    chance = chance_macro_f(confusion, rng=rng, draws=draws)
    low, high = chance.range95
    better = "better than chance" if chance.p < 0.05 else "no better than chance"
    limits = interval_words(macro_f_limits, confusion.by_person, form=".3f")
    return (
        f"Macro F, the mean of F over the objects, is {confusion.macro_f:.3f} ({limits}), {better}: shuffled answers"
        f" give {chance.mean:.3f}, 95 % of them {low:.3f} to {high:.3f} ({p_words(chance.p)})."
    )


def _sensitivity_words(confusion: Confusion) -> str:
    counts = confusion.counts
    sense = d_prime_choice(int(np.trace(counts)), int(counts.sum()), alternatives=counts.shape[1])
    limits = interval_words(d_prime_limits, confusion.by_person)
    return f"d' is {sense.d_prime:.2f} ({limits}{'; corrected for a rate of 0 or 1' if sense.corrected else ''})."


def compared(pair: tuple[Choices, ...], data: StudyData, *, rng: np.random.Generator) -> list[Finding]:
    """F-measures of two conditions: over objects as in the paper, and over participants."""
    first, second = pair
    names = f"{first.name} and {second.name}"
    title = "Effect of the condition on identification"
    return [
        *attempt(f"{title}, over objects as in the paper", lambda: [_over_objects(first, second, names)]),
        *attempt(f"{title}, over people", lambda: _over_people(first, second, data, names, rng)),
    ]


def _over_objects(first: Choices, second: Choices, names: str) -> Finding:
    labels = [", ".join(map(str, one.confusion.labels)) for one in (first, second)]
    if labels[0] != labels[1]:
        raise InputError(f"objects: expected the same in both conditions, got {labels[0]}, and {labels[1]}")
    found = paired_t(first.confusion.f_measure, second.confusion.f_measure)
    words = (
        f"Paired t over {found.n} objects, {names}: t({found.df}) = {found.t:.2f}, {p_words(found.p)}. This is the test"
        " of the paper. Its unit is the object, not the person: with so few pairs its power is low, and"
        " differences that are similar by chance give a small p-value. Use the test over people instead."
    )
    return Finding(title="Effect of the condition over objects, as in the paper", words=words)


def _over_people(
    first: Choices, second: Choices, data: StudyData, names: str, rng: np.random.Generator
) -> list[Finding]:
    both = [who for who in first.confusion.participants if who in second.confusion.participants]
    if len(both) < 2:
        raise InputError(f"pairs: expected two or more people with both conditions, got {len(both)}")
    pick = [[one.participants.index(who) for who in both] for one in (first.confusion, second.confusion)]
    a, b = first.confusion.macro_f_by_person[pick[0]], second.confusion.macro_f_by_person[pick[1]]
    found = paired_t(a, b)
    same = equivalence(a, b, margin=data.margin)
    evidence = bayes_factor(found.t, found.n)
    exact = sign_flip(a - b, rng=rng)
    verdict = (
        f"The conditions are equivalent within {data.margin:g}"
        if same.p < 0.05
        else f"Equivalence within {data.margin:g} is not shown"
    )
    strength = max(evidence, 1 / evidence)
    side = "for a difference" if evidence > 1 else "for no difference"
    words = (
        f"Macro F of each of {found.n} people, {names}: mean difference {found.difference:.3f} ({found.low:.3f} to"
        f" {found.high:.3f}), t({found.df}) = {found.t:.2f}, {p_words(found.p)}; sign-flip test {p_words(exact)}."
        f" {verdict} (TOST {p_words(same.p)}, 90 % limits {same.low:.3f} to {same.high:.3f}). Bayes factor"
        f" {strength:.1f} {side}{'' if strength >= 3 else ', inconclusive'}."
    )
    return [Finding(title="Effect of the condition over people", words=words)]
