"""A question of a study and the check of its answers; a stimulus, and the correct answer to a question about it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Literal

import numpy as np

from midair.errors import InputError
from midair.validation import one_of, within

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
    shuffle: bool = False
    """Whether the options of a choice are in a random order in each trial; see `in_order_of`."""

    def __post_init__(self) -> None:
        one_of(self.kind, QuestionKind, f"question {self.name!r}: kind")
        if blank := [option for option in self.options if option != option.strip() or not option]:
            raise InputError(
                f"question {self.name!r}: expected options without leading or trailing spaces, got {blank[0]!r}"
            )
        within(self.timeout_s, f"question {self.name!r}: timeout_s", 0, unit="s")
        if self.kind == "choice" and (len(set(self.options)) < 2 or len(set(self.options)) < len(self.options)):
            raise InputError(f"question {self.name!r}: expected two or more different options, got {self.options}")
        if self.shuffle and self.kind != "choice":
            raise InputError(f"question {self.name!r}: expected shuffle for a choice only, got a {self.kind}")
        if self.kind in ("rating", "slider") and not self.low < self.high:
            raise InputError(f"question {self.name!r}: expected low below high, got {self.low} and {self.high}")

    def in_order_of(self, trial: str, *, seed: int) -> "Question":
        """The question with its options in the random order of a trial (its code), the same for the same seed."""
        if not self.shuffle:
            return self
        words = sha256(f"{trial} {self.name}".encode()).digest()
        order = np.random.default_rng([seed, int.from_bytes(words[:8], "big")]).permutation(len(self.options))
        return replace(self, options=tuple(self.options[place] for place in order))

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


def _number(given: str, low: float, high: float, expected: str) -> str:
    try:
        value = float(given)
    except ValueError:
        # NaN fails the range check below.
        value = float("nan")
    if not low <= value <= high or value == float("inf"):
        raise InputError(f"answer: expected {expected}, got {given!r}")
    return f"{value:g}"


StimulusKind = Literal["drive", "object", "silence", "pair", "text", "picture", "sound"]
"""A drive that an array plays; a real object that the experimenter presents; nothing (catch trial); two stimuli in a
row; a text; a picture or a sound, which only the participant's page in the studio presents."""

ENDINGS = {"picture": (".png", ".jpg", ".jpeg", ".webp"), "sound": (".wav", ".flac", ".mp3", ".ogg")}
"""File names of pictures and sounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """A drive, a real object, silence, or a pair of stimuli."""

    name: str
    """Identifier in the plan; participants never see it."""
    kind: StimulusKind = "drive"
    source: str = ""
    """File of the drive, picture or sound; the object that the experimenter presents; or the text."""
    duration_s: float = 1.0
    """How long a text or picture is shown, in s."""
    made_from: str = ""
    """Source of a missing drive, as in `midair record`: ``virtual:towel+groove``. Such drives are SIMULATED."""
    share: float = 1.0
    """Share of the drive's radiation pressure that is played, above 0 to 1."""
    members: tuple[str, ...] = ()
    """Names of the two stimuli of a pair."""
    either_order: str = ""
    """Factor of a pair whose level, "first" or "second", is the position of the first member; both orders are drawn
    equally often (`both_orders`). If empty, the order of `members` is kept."""
    gap_s: float = 0.5
    """Silence between the members of a pair, in s."""
    code: int = 2
    """Byte of the event marker at its start, 2 or 5 to 255. Different codes reveal the condition in the log."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Level of each factor, such as ``{"object": "towel"}``."""

    def __post_init__(self) -> None:
        one_of(self.kind, StimulusKind, f"stimulus {self.name!r}: kind")
        if (self.kind == "pair") != (len(self.members) == 2):
            raise InputError(
                f"stimulus {self.name!r}: expected two members for a pair and none otherwise, got {list(self.members)}"
            )
        if (self.either_order and self.kind != "pair") or not 0 <= self.gap_s < float("inf"):
            raise InputError(f"stimulus {self.name!r}: expected either_order only for pairs, and gap_s of 0 s or more")
        if not 0 < self.share <= 1 or (self.made_from and not self.made_from.startswith("virtual:")):
            raise InputError(
                f"stimulus {self.name!r}: expected share above 0 to 1 and made_from virtual:NAME, got {self.share:g} "
                f"and {self.made_from!r}"
            )
        if self.code != 2 and not 5 <= self.code <= 255:
            raise InputError(
                f"stimulus {self.name!r}: expected code 2 or 5 to 255 (1, 3 and 4 mark trials and answers),"
                f" got {self.code}"
            )
        if self.kind not in ("silence", "pair") and not self.source:
            raise InputError(f"stimulus {self.name!r}: expected the source of the {self.kind}, got none")
        filed = self.kind in ("drive", "picture", "sound")
        if filed and (self.source.startswith("/") or ".." in self.source.split("/")):
            raise InputError(
                f"stimulus {self.name!r}: expected a {self.kind} below the plan's folder, got {self.source!r}"
            )
        if self.kind in ENDINGS and not self.source.lower().endswith(ENDINGS[self.kind]):
            raise InputError(
                f"stimulus {self.name!r}: expected a {self.kind} ({', '.join(ENDINGS[self.kind])}), got {self.source!r}"
            )
        if not 0 < self.duration_s <= 3600:
            raise InputError(
                f"stimulus {self.name!r}: expected duration_s above 0 to 3600 s, got {self.duration_s:g} s"
            )


def both_orders(stimulus: Stimulus) -> tuple[Stimulus, ...]:
    """The two orders of a pair, each as a stimulus with its level of the factor; any other stimulus unchanged."""
    if not stimulus.either_order:
        return (stimulus,)
    return tuple(
        replace(
            stimulus,
            name=f"{stimulus.name}_{place}",
            members=stimulus.members[::way],
            either_order="",
            levels={**stimulus.levels, stimulus.either_order: place},
        )
        for place, way in (("first", 1), ("second", -1))
    )


def right_answer(question: Question, stimulus: Stimulus, levels: Mapping[str, str]) -> str:
    """Correct answer to a question about a stimulus; empty if the question has none."""
    if question.truth:
        return levels.get(question.truth, "")
    if question.kind == "yes-no":
        return "no" if stimulus.kind == "silence" else "yes"
    if question.kind == "same-different" and stimulus.members:
        return "same" if stimulus.members[0] == stimulus.members[1] else "different"
    return ""
