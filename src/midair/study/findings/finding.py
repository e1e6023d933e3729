"""A part of a report, and how its numbers are said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import InputError
from midair.study.statistics import Confusion, Interval, Scale, limits_over_people

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Finding:
    """One part of a report.

    Attributes
    ----------
    title : str
        Its heading.
    words : str
        What was found, for somebody who does not read tables.
    table : DataFrame or None
        The figures.
    """

    title: str
    words: str
    table: DataFrame | None = None

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Each column of the table that needs a word, and the word."""
        names = [] if self.table is None else [str(name) for name in self.table.columns]
        return tuple((name, MEANING[name]) for name in names if name in MEANING)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choices:
    """Confusions of one condition, for the figures.

    Attributes
    ----------
    name : str
        Of the condition.
    confusion : Confusion
        Counts.
    f_limits : Interval or None
        F of each object over people; None with fewer than five of them.
    left_out : int
        Answers that name what was never presented and are not counted.
    """

    name: str
    confusion: Confusion
    f_limits: Interval | None
    left_out: int = 0


def p_words(p: float) -> str:
    """A p-value as people print it."""
    return "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".", 1)


def note_last(table: DataFrame) -> DataFrame:
    """A table with its notes in the last column, where they may be as long as they like."""
    from pandas import DataFrame

    names = [str(name) for name in table.columns if name != "note"]
    return DataFrame(table, columns=[*names, "note"])


def attempt(title: str, make: Callable[[], list[Finding]]) -> list[Finding]:
    """What `make` finds, or the word on why it cannot."""
    try:
        return make()
    except InputError as wrong:
        return [Finding(title=title, words=f"Not computed. {str(wrong)[0].upper()}{str(wrong)[1:]}.")]


def limits_words(
    statistic: Callable[[NDArray[Any]], float], by_person: NDArray[Any], scale: Scale, *, form: str = ".2f"
) -> str:
    """Limits of a figure over people in words, or why there are none."""
    return interval_words(lambda people: limits_over_people(statistic, people, scale=scale), by_person, form=form)


def interval_words(limits: Callable[[NDArray[Any]], Interval], by_person: NDArray[Any], *, form: str = ".2f") -> str:
    """The same for a figure whose limits have a function of their own."""
    try:
        found = limits(by_person)
    except InputError as wrong:
        if len(by_person) < 5:
            return f"no limits with {len(by_person)} people, who are fewer than five"
        return f"no {wrong}"
    if not np.isfinite(found.low):
        return "no limits, since nothing shows how people differ"
    return f"95 % over people {float(found.low):{form}} to {float(found.high):{form}}"


MEANING: Mapping[str, str] = {
    "object": "what was presented",
    "presented": "how often it was",
    "answered": "how often it was the answer",
    "precision": "share of those answers that were right",
    "recall": "share of its presentations that were recognised",
    "F": "in choices, the harmonic mean of precision and recall; in tests, the ratio that p comes from",
    "F_low": "lower 95 % limit of F over people",
    "F_high": "upper 95 % limit of F over people",
    "effect": "what may matter; a colon joins factors whose effects depend on each other",
    "df": "degrees of freedom of the effect",
    "df1": "degrees of freedom of the effect",
    "df2": "degrees of freedom of its error",
    "chi2": "likelihood ratio against the model without the effect",
    "p": "chance of so much or more if there were no effect, uncorrected",
    "p_GG": "the same with Greenhouse and Geisser's correction for contrasts that vary unequally",
    "p_HF": "the same with Huynh and Feldt's correction, which is less strict",
    "p_Holm": "p corrected by Holm for the number of effects in this table: read this one",
    "p_sign": "p from turning the signs of whole people, which assumes no distribution",
    "eps_GG": "Greenhouse and Geisser's epsilon: 1 if contrasts vary equally, less if not",
    "eps_HF": "Huynh and Feldt's epsilon",
    "W": "Mauchly's statistic: 1 if contrasts vary equally",
    "p_W": "its p; it misses much with few people",
    "np2": "partial eta squared: share of effect and error that is effect",
    "ges": "generalised eta squared, for comparison with other designs",
    "spread": "how much people differ in the effect, in logits",
    "level": "strength of the stimulus",
    "right": "right answers",
    "answers": "all answers",
    "share": "right answers of all",
    "participant": "who",
    "rule": "rule of the plan that leaves this person out",
    "value": "what was found",
    "limit": "what the plan allows",
    "block": "block of the plan",
    "threshold": "strength at the threshold, in the unit of the strengths",
    "sd": "standard deviation of what is known of the threshold (QUEST+)",
    "stimulus": "what was presented",
    "answer": "what was answered",
    "question": "question of the plan",
    "kind": "kind of its answers",
    "given": "number of answers",
    "analysed": "number of answers that are analysed",
    "part": "part of this report that analyses them, or why none does",
    "people": "number of people",
    "mean_rating": "mean over people, each by the mean of the own answers",
    "sd_people": "standard deviation of people's means",
    "mean": "geometric mean of the magnitudes",
    "note": "why a number is missing or unsafe",
}
"""A word on each column of the tables of a report."""
