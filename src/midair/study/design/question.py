"""Something to ask after a stimulus, and what counts as an answer to it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from midair.errors import InputError

QuestionKind = Literal["choice", "rating", "magnitude", "yes-no", "same-different", "slider", "text"]
"""One of several names; a whole number on a scale; any number of 0 or more; yes or no; same or different; a number
between two ends; words."""

LONGEST_TEXT = 2000
"""Letters of a text that are stored."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Something to ask after a stimulus.

    Attributes
    ----------
    name : str
        Name of the column.
    kind : {"choice", "rating", "magnitude", "yes-no", "same-different", "slider", "text"}
        What an answer may be.
    text : str
        As it is asked.
    options : tuple of str
        Options of a choice.
    low, high : int
        Ends of a rating or of a slider.
    low_label, high_label : str
        What the ends mean.
    truth : str
        Factor whose level is the right answer; empty where there is none. "yes-no" asks for anything but silence,
        "same-different" for the two members of the pair, if `truth` is empty.
    levels : mapping of str to str
        Levels that the question itself adds, such as ``{"rated": "towel"}``.
    timeout_s : float
        Time after which no answer is taken any more, in s; 0 for as long as it takes.
    private : bool
        Whether the answer stays in the log and goes into no table.
    """

    name: str
    kind: QuestionKind
    text: str
    options: tuple[str, ...] = ()
    low: int = 1
    high: int = 7
    low_label: str = ""
    high_label: str = ""
    truth: str = ""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    timeout_s: float = 0.0
    private: bool = False

    def __post_init__(self) -> None:
        one_of(self.kind, QuestionKind, f"question {self.name!r}: kind")
        if blank := [option for option in self.options if option != option.strip() or not option]:
            raise InputError(f"question {self.name!r}: expected options without space around them, got {blank[0]!r}")
        if not 0 <= self.timeout_s < float("inf"):
            raise InputError(f"question {self.name!r}: expected timeout_s of 0 or more, got {self.timeout_s:g}")
        if self.kind == "choice" and (len(set(self.options)) < 2 or len(set(self.options)) < len(self.options)):
            raise InputError(f"question {self.name!r}: expected two or more different options, got {self.options}")
        if self.kind in ("rating", "slider") and not self.low < self.high:
            raise InputError(f"question {self.name!r}: expected low below high, got {self.low} and {self.high}")

    @property
    def answers(self) -> tuple[str, ...]:
        """Everything that may be answered; empty where that is any number or any text."""
        fixed = {"yes-no": ("yes", "no"), "same-different": ("same", "different"), "choice": self.options}
        scale = tuple(str(n) for n in range(self.low, self.high + 1)) if self.kind == "rating" else ()
        return fixed.get(self.kind, scale)

    @property
    def numbered(self) -> bool:
        """Whether 1, 2 and so on stand for the answers.

        Not where an answer begins with the number of another: of 2, 3, 4, a typed "2" would be the second as well.
        """
        return self.kind != "rating" and not any(
            option.startswith(str(number))
            for number in range(1, len(self.answers) + 1)
            for place, option in enumerate(self.answers, start=1)
            if place != number
        )

    @property
    def keys(self) -> Mapping[str, str]:
        """The answer that one key gives, by the key; empty if one key does not reach every answer."""
        if self.numbered and 0 < len(self.answers) <= 9:
            return {str(number): answer for number, answer in enumerate(self.answers, start=1)}
        return {answer: answer for answer in self.answers} if all(len(answer) == 1 for answer in self.answers) else {}

    def read(self, text: str) -> str:
        """An answer as it is stored; the number of an option, and the beginning of one, count as the option.

        Raises
        ------
        InputError
            If it is no answer to this question.
        """
        said = text.strip()
        if self.kind == "magnitude":
            return _number(said, 0, float("inf"), "a number of 0 or more")
        if self.kind == "slider":
            return _number(said, self.low, self.high, f"a number from {self.low} to {self.high}")
        if self.kind == "text":
            return "".join(letter if letter.isprintable() else " " for letter in said)[:LONGEST_TEXT]
        if said in self.answers:
            return said
        if self.numbered and said.isdecimal() and 1 <= int(said) <= len(self.answers):
            return self.answers[int(said) - 1]
        # A number that is no whole answer is a slip of a key, and not the beginning of one.
        begun = [option for option in self.answers if said and option.lower().startswith(said.lower())]
        if self.kind != "rating" and len(begun) == 1 and (self.numbered or not said.isdecimal()):
            return begun[0]
        raise InputError(f"answer: expected one of {', '.join(self.answers)}, got {said!r}")


def one_of(value: str, kinds: Any, what: str) -> None:
    """Check that a word is one of a Literal's.

    Raises
    ------
    InputError
        If it is not.
    """
    if value not in get_args(kinds):
        raise InputError(f"{what}: expected one of {', '.join(get_args(kinds))}, got {value!r}")


def _number(said: str, low: float, high: float, expected: str) -> str:
    try:
        value = float(said)
    except ValueError:
        # Refused below, as it is not between the ends.
        value = float("nan")
    if not low <= value <= high or value == float("inf"):
        raise InputError(f"answer: expected {expected}, got {said!r}")
    return f"{value:g}"
