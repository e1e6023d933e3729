"""A part of a report, and how its numbers are said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from midair.errors import InputError
from midair.study.statistics import Confusion, Interval

if TYPE_CHECKING:
    from collections.abc import Callable

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
        F of each object over people; None with one person.
    """

    name: str
    confusion: Confusion
    f_limits: Interval | None


def p_words(p: float) -> str:
    """A p-value as people print it."""
    return "p < .001" if p < 0.001 else f"p = {p:.3f}".replace("0.", ".", 1)


def attempt(title: str, make: Callable[[], list[Finding]]) -> list[Finding]:
    """What `make` finds, or the word on why it cannot."""
    try:
        return make()
    except InputError as wrong:
        return [Finding(title=title, words=f"Not computed. {str(wrong)[0].upper()}{str(wrong)[1:]}.")]
