"""A question of a study, and the check of its answers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from midair.errors import InputError

QuestionKind = Literal["choice", "rating", "magnitude", "yes-no", "same-different", "slider", "text"]
"""One of several options; an integer on a scale; any number of 0 or more; yes or no; same or different; a number
between two ends; free text."""

LONGEST_TEXT = 2000
"""Largest number of stored characters of a free text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """A question asked after a stimulus or in the form."""

    name: str
    """Name of the question, and of its column for a question of the form."""
    kind: QuestionKind
    text: str
    options: tuple[str, ...] = ()
    """Options of a choice."""
    low: int = 1
    high: int = 7
    """`low` and `high` are the ends of a rating or slider."""
    low_label: str = ""
    high_label: str = ""
    """`low_label` and `high_label` name the ends."""
    truth: str = ""
    """Factor whose level is the correct answer. If empty, a yes-no question is correct with "yes" for any stimulus but
    silence, a same-different question by the members of the pair; other kinds have no correct answer."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Levels that the question adds, such as ``{"rated": "towel"}``."""
    timeout_s: float = 0.0
    """Time limit for an answer, in s; 0 for no limit."""
    private: bool = False
    """Whether the answer stays in the log and is left out of all tables."""

    def __post_init__(self) -> None:
        one_of(self.kind, QuestionKind, f"question {self.name!r}: kind")
        if blank := [option for option in self.options if option != option.strip() or not option]:
            raise InputError(
                f"question {self.name!r}: expected options without leading or trailing spaces, got {blank[0]!r}"
            )
        if not 0 <= self.timeout_s < float("inf"):
            raise InputError(f"question {self.name!r}: expected timeout_s of 0 or more, got {self.timeout_s:g}")
        if self.kind == "choice" and (len(set(self.options)) < 2 or len(set(self.options)) < len(self.options)):
            raise InputError(f"question {self.name!r}: expected two or more different options, got {self.options}")
        if self.kind in ("rating", "slider") and not self.low < self.high:
            raise InputError(f"question {self.name!r}: expected low below high, got {self.low} and {self.high}")

    @property
    def answers(self) -> tuple[str, ...]:
        """All possible answers; empty if any number or text is allowed."""
        fixed = {"yes-no": ("yes", "no"), "same-different": ("same", "different"), "choice": self.options}
        scale = tuple(str(n) for n in range(self.low, self.high + 1)) if self.kind == "rating" else ()
        return fixed.get(self.kind, scale)

    @property
    def numbered(self) -> bool:
        """Whether 1, 2 and so on select the answers.

        False if an answer begins with the number of another one: with the options 2, 3, 4, a typed "2" would be
        ambiguous.
        """
        return self.kind != "rating" and not any(
            option.startswith(str(number))
            for number in range(1, len(self.answers) + 1)
            for place, option in enumerate(self.answers, start=1)
            if place != number
        )

    @property
    def keys(self) -> Mapping[str, str]:
        """Answer selected by each single key; empty if single keys cannot select every answer."""
        if self.numbered and 0 < len(self.answers) <= 9:
            return {str(number): answer for number, answer in enumerate(self.answers, start=1)}
        return {answer: answer for answer in self.answers} if all(len(answer) == 1 for answer in self.answers) else {}

    def read(self, text: str) -> str:
        """Parse an answer; the number or an unambiguous beginning of an option selects it. InputError if invalid."""
        given = text.strip()
        if self.kind == "magnitude":
            return _number(given, 0, float("inf"), "a number of 0 or more")
        if self.kind == "slider":
            return _number(given, self.low, self.high, f"a number from {self.low} to {self.high}")
        if self.kind == "text":
            return "".join(letter if letter.isprintable() else " " for letter in given)[:LONGEST_TEXT]
        if given in self.answers:
            return given
        if self.numbered and given.isdecimal() and 1 <= int(given) <= len(self.answers):
            return self.answers[int(given) - 1]
        # A number that is not a complete answer is a typing error, not the beginning of an answer.
        begun = [option for option in self.answers if given and option.lower().startswith(given.lower())]
        if self.kind != "rating" and len(begun) == 1 and (self.numbered or not given.isdecimal()):
            return begun[0]
        raise InputError(f"answer: expected one of {', '.join(self.answers)}, got {given!r}")


def one_of(value: str, kinds: Any, what: str) -> None:
    """Raise InputError if a value is not one of those of a Literal."""
    if value not in get_args(kinds):
        raise InputError(f"{what}: expected one of {', '.join(get_args(kinds))}, got {value!r}")


def _number(given: str, low: float, high: float, expected: str) -> str:
    try:
        value = float(given)
    except ValueError:
        # NaN fails the range check below.
        value = float("nan")
    if not low <= value <= high or value == float("inf"):
        raise InputError(f"answer: expected {expected}, got {given!r}")
    return f"{value:g}"
