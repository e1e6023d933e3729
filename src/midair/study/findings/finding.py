"""One part of a report, and the text of its numbers."""

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
    """One part of a report."""

    title: str
    words: str
    """Result in words."""
    table: DataFrame | None = None
    """Table of the numbers."""

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Names and explanations of the table's columns."""
        names = [] if self.table is None else [str(name) for name in self.table.columns]
        return tuple((name, MEANING[name]) for name in names if name in MEANING)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choices:
    """Confusion matrix of one condition."""

    name: str
    """Name of the condition."""
    confusion: Confusion
    f_limits: Interval | None
    """Confidence interval of F of each object over participants; None with fewer than five."""
    left_out: int = 0
    """Number of answers left out because they name an object that was never presented."""


def p_words(p: float) -> str:
    """P-value in the usual format, such as "p < .001" or "p = .030"."""
    return "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".", 1)


def note_last(table: DataFrame) -> DataFrame:
    """The table with the column "note" last."""
    from pandas import DataFrame

    names = [str(name) for name in table.columns if name != "note"]
    return DataFrame(table, columns=[*names, "note"])


def attempt(title: str, make: Callable[[], list[Finding]]) -> list[Finding]:
    """Findings of `make`, or one finding with the reason of its InputError."""
    try:
        return make()
    except InputError as wrong:
        return [Finding(title=title, words=f"Not computed. {str(wrong)[0].upper()}{str(wrong)[1:]}.")]


def limits_words(
    statistic: Callable[[NDArray[Any]], float], by_person: NDArray[Any], scale: Scale, *, form: str = ".2f"
) -> str:
    """Confidence interval of a statistic over participants as text, or the reason why there is none."""
    return interval_words(lambda people: limits_over_people(statistic, people, scale=scale), by_person, form=form)


def interval_words(limits: Callable[[NDArray[Any]], Interval], by_person: NDArray[Any], *, form: str = ".2f") -> str:
    """As `limits_words`, for a function that returns the interval."""
    try:
        found = limits(by_person)
    except InputError as wrong:
        if len(by_person) < 5:
            return f"no limits with fewer than five people, got {len(by_person)}"
        return f"no {wrong}"
    if not np.isfinite(found.low):
        return "no limits, since the differences between people are unknown"
    return f"95 % limits over people {float(found.low):{form}} to {float(found.high):{form}}"


MEANING: Mapping[str, str] = {
    "object": "presented object",
    "presented": "number of presentations of the object",
    "answered": "number of answers that name the object",
    "precision": "share of correct answers among those that name the object",
    "recall": "share of correct answers among its presentations",
    "F": "in choices, the harmonic mean of precision and recall; in tests, the F statistic",
    "F_low": "lower 95 % limit of F over people",
    "F_high": "upper 95 % limit of F over people",
    "effect": "tested factor; a colon joins the factors of an interaction",
    "df": "degrees of freedom of the effect",
    "df1": "degrees of freedom of the effect",
    "df2": "degrees of freedom of its error",
    "chi2": "likelihood ratio against the model without the effect",
    "p": "p-value without correction: probability of an effect at least as large if there is none",
    "p_GG": "p-value with the correction of Greenhouse and Geisser for violated sphericity",
    "p_HF": "p-value with the less strict correction of Huynh and Feldt",
    "p_Holm": "p-value corrected by Holm for the number of effects in this table: use this one",
    "p_sign": "p-value of a sign-flip permutation test over people, without a distributional assumption",
    "eps_GG": "epsilon of Greenhouse and Geisser: 1 under sphericity, otherwise less",
    "eps_HF": "epsilon of Huynh and Feldt",
    "W": "Mauchly's statistic: 1 under sphericity",
    "p_W": "p-value of W; low power with few people",
    "np2": "partial eta squared: effect / (effect + error), in sums of squares",
    "ges": "generalised eta squared, for comparison with other designs",
    "np2_low": "lower 90 % limit of np2; above 0 if p_GG is below .05",
    "np2_high": "upper 90 % limit of np2",
    "ges_low": "lower 90 % limit of ges",
    "ges_high": "upper 90 % limit of ges",
    "first": "first level of the pair",
    "second": "second level of the pair",
    "difference": "mean of the first minus mean of the second",
    "t": "t statistic",
    "p_pairs": "p-value corrected for the number of pairs of the effect: use this one",
    "correction": "method of the correction for the number of pairs",
    "d": "difference in standard deviations: of the differences (within people), or of people in a group (between)",
    "d_low": "lower 95 % limit of d",
    "d_high": "upper 95 % limit of d",
    "spread": "standard deviation of the effect between people, in logits",
    "level": "strength of the stimulus",
    "right": "number of correct answers",
    "answers": "number of answers",
    "share": "share of correct answers",
    "participant": "participant",
    "rule": "rule of the plan that excludes the participant",
    "value": "measured value",
    "limit": "limit set by the plan",
    "block": "block of the plan",
    "threshold": "strength at the threshold, in the unit of the strengths",
    "sd": "standard deviation of the posterior of the threshold",
    "low": "lower 95 % limit",
    "high": "upper 95 % limit",
    "trials": "number of analysed answers",
    "bias": "false-alarm rate (yes or no), or side bias in standard deviations (two sides; above 0: the first)",
    "lapse": "lapse rate",
    "p_misfit": "p-value of the misfit of the model; below .01 the threshold is refused",
    "stimulus": "presented stimulus",
    "answer": "given answer",
    "question": "question of the plan",
    "text": "words of the question",
    "kind": "kind of answers",
    "given": "number of answers",
    "analysed": "number of analysed answers",
    "part": "part of this report with the analysis, or the reason why there is none",
    "people": "number of people",
    "mean_rating": "mean of the people's means",
    "sd_people": "standard deviation of the people's means",
    "mean": "geometric mean of the magnitudes",
    "note": "reason why a number is missing or unreliable",
}
"""Explanation of each column in the tables of a report."""
