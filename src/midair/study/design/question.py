"""Something to ask after a stimulus, and what counts as an answer to it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from midair.errors import InputError

QuestionKind = Literal["choice", "rating", "magnitude", "yes-no", "same-different"]
"""One of several names; a whole number on a scale; any number of 0 or more; yes or no; same or different."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Something to ask after a stimulus.

    Attributes
    ----------
    name : str
        Name of the column.
    kind : {"choice", "rating", "magnitude", "yes-no", "same-different"}
        What an answer may be.
    text : str
        As it is asked.
    options : tuple of str
        Options of a choice.
    low, high : int
        Ends of a rating.
    low_label, high_label : str
        What the ends mean.
    truth : str
        Factor whose level is the right answer; empty where there is none. "yes-no" asks for anything but silence,
        "same-different" for the two members of the pair, if `truth` is empty.
    levels : mapping of str to str
        Levels that the question itself adds, such as ``{"rated": "towel"}``.
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

    def __post_init__(self) -> None:
        one_of(self.kind, QuestionKind, f"question {self.name!r}: kind")
        if self.kind == "choice" and (len(set(self.options)) < 2 or len(set(self.options)) < len(self.options)):
            raise InputError(f"question {self.name!r}: expected two or more different options, got {self.options}")
        if self.kind == "rating" and not self.low < self.high:
            raise InputError(f"question {self.name!r}: expected low below high, got {self.low} and {self.high}")

    @property
    def answers(self) -> tuple[str, ...]:
        """Everything that may be answered; empty for a magnitude."""
        fixed = {"yes-no": ("yes", "no"), "same-different": ("same", "different"), "choice": self.options}
        scale = tuple(str(n) for n in range(self.low, self.high + 1)) if self.kind == "rating" else ()
        return fixed.get(self.kind, scale)

    def read(self, text: str) -> str:
        """An answer as it is stored; the number of an option, and the beginning of one, count as the option.

        Raises
        ------
        InputError
            If it is no answer to this question.
        """
        said = text.strip()
        if self.kind == "magnitude":
            return _magnitude(said)
        if said in self.answers:
            return said
        # Of a rating the digits are the answers themselves.
        if self.kind != "rating" and said.isdigit() and 1 <= int(said) <= len(self.answers):
            return self.answers[int(said) - 1]
        begun = [option for option in self.answers if said and option.lower().startswith(said.lower())]
        if self.kind != "rating" and len(begun) == 1:
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


def _magnitude(said: str) -> str:
    try:
        value = float(said)
    except ValueError:
        # Refused below, as no answer is less than 0.
        value = -1.0
    if not 0 <= value < float("inf"):
        raise InputError(f"answer: expected a number of 0 or more, got {said!r}")
    return f"{value:g}"
