"""What a study is made of: stimuli, questions, blocks, and the order that is promised."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from midair.errors import InputError, MismatchError
from midair.study.design.question import Question, one_of

StimulusKind = Literal["drive", "object", "silence", "pair"]
"""A drive that an array plays; a real object that the experimenter presents; nothing; two stimuli in a row."""

Order = Literal["shuffle", "rounds", "fixed"]
"""All trials of a block mixed; every stimulus once, in a new order, repetition by repetition; as written."""


Adaptive = Literal["", "staircase", "quest+"]
"""A plan drawn beforehand; 3-down/1-up; QUEST+."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """Something to feel: a drive, an object, nothing, or a pair.

    Attributes
    ----------
    name : str
        Known to nobody but the plan.
    kind : {"drive", "object", "silence", "pair"}
        How it is presented.
    source : str
        File of the drive, or what the experimenter is to take up.
    members : tuple of str
        Names of the two stimuli of a pair.
    levels : mapping of str to str
        Level of each factor, such as ``{"object": "towel"}``.
    """

    name: str
    kind: StimulusKind = "drive"
    source: str = ""
    members: tuple[str, ...] = ()
    levels: Mapping[str, str] = field(default_factory=dict[str, str])

    def __post_init__(self) -> None:
        one_of(self.kind, StimulusKind, f"stimulus {self.name!r}: kind")
        if (self.kind == "pair") != (len(self.members) == 2):
            raise InputError(f"stimulus {self.name!r}: expected two members of a pair, got {list(self.members)}")
        if self.kind in ("drive", "object") and not self.source:
            raise InputError(f"stimulus {self.name!r}: expected the source of the {self.kind}, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Trials that belong together.

    Attributes
    ----------
    name : str
        Name of the block.
    stimuli, questions : tuple of str
        Names.
    repetitions : int
        Trials of each stimulus.
    order : {"shuffle", "rounds", "fixed"}
        Order of the trials.
    longest_run : int
        Most trials with the same stimulus in a row; 0 for no limit.
    group : str
        Blocks of one group follow each other as written; the block's own name if empty. Groups are what
        `Design.counterbalanced` puts in order.
    scored : bool
        False for familiarisation: stored, not analysed.
    levels : mapping of str to str
        Levels of all its trials.
    text : str
        Told to the participant before the first trial.
    rest_s : float
        Shortest break after the block, in s.
    adaptive : {"", "staircase", "quest+"}
        What chooses the stimuli from the answers to the first question; `repetitions` is then the number of trials.
    strength : str
        Factor whose levels are the strengths of an adaptive block's stimuli, as numbers.
    """

    name: str
    stimuli: tuple[str, ...]
    questions: tuple[str, ...]
    repetitions: int = 1
    order: Order = "shuffle"
    longest_run: int = 0
    group: str = ""
    scored: bool = True
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    text: str = ""
    rest_s: float = 0.0
    adaptive: Adaptive = ""
    strength: str = ""

    def __post_init__(self) -> None:
        one_of(self.order, Order, f"block {self.name!r}: order")
        one_of(self.adaptive, Adaptive, f"block {self.name!r}: adaptive")
        if bool(self.adaptive) != bool(self.strength) or (self.adaptive and len(self.stimuli) < 3):
            raise InputError(f"block {self.name!r}: expected adaptive, strength and three stimuli or more, or neither")
        if not self.stimuli or self.repetitions < 1 or self.longest_run < 0 or self.rest_s < 0:
            raise InputError(
                f"block {self.name!r}: expected stimuli, repetitions of 1 or more, longest_run and rest_s of 0 or more"
            )
        if not self.group:
            object.__setattr__(self, "group", self.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What will be tested, said before the first participant.

    Attributes
    ----------
    choice : str
        The question of the confusion matrix; none if empty.
    condition : str
        Factor of two levels whose F-measures are compared; none if empty.
    only : mapping of str to str
        Levels that a trial must have to count, such as ``{"presentation": "reproduced"}``.
    rated : tuple of str
        Questions of the analysis of variance; none if empty.
    within : tuple of str
        Its factors.
    strength : str
        Factor whose levels are numbers: a psychometric function is fitted to right answers; none if empty.
    guess : float
        Chance of a right answer without a stimulus, for that function: 1/m with m alternatives.
    margin : float
        Difference of macro F between conditions that does not matter.
    """

    choice: str = ""
    condition: str = ""
    only: Mapping[str, str] = field(default_factory=dict[str, str])
    rated: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    strength: str = ""
    guess: float = 0.5
    margin: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A study, before chance has been asked.

    Attributes
    ----------
    name : str
        Letters and digits only: it becomes the task of BIDS file names.
    title : str
        What the study is called for people.
    participants : int
        Number of people for whom the trials are drawn.
    seed : int
        Seed of all shuffles.
    stimuli, questions, blocks : tuple
        The parts.
    counterbalanced : tuple of str
        Groups of blocks that go through a balanced Latin square; the others stay where they are written.
    consent, debrief : str
        Told before and after.
    analysis : Analysis
        What will be tested.
    """

    name: str
    participants: int
    seed: int
    stimuli: tuple[Stimulus, ...]
    questions: tuple[Question, ...]
    blocks: tuple[Block, ...]
    title: str = ""
    counterbalanced: tuple[str, ...] = ()
    consent: str = ""
    debrief: str = ""
    analysis: Analysis = field(default_factory=Analysis)

    def __post_init__(self) -> None:
        if not (self.name.isascii() and self.name.isalnum()):
            raise InputError(f"study: expected a name of letters and digits, got {self.name!r}")
        if self.participants < 1 or not self.blocks:
            raise InputError(f"study: expected participants and blocks, got {self.participants}, {len(self.blocks)}")
        names = {kind: [part.name for part in parts] for kind, parts in self._parts().items()}
        for kind, listed in names.items():
            if len(set(listed)) < len(listed):
                raise InputError(f"{kind}: expected different names, got {sorted(listed)}")
        for block in self.blocks:
            _known(block.stimuli, names["stimuli"], f"block {block.name!r}: stimuli")
            _known(block.questions, names["questions"], f"block {block.name!r}: questions")
        for stimulus in self.stimuli:
            _known(stimulus.members, names["stimuli"], f"stimulus {stimulus.name!r}: members")
        _known(self.counterbalanced, [block.group for block in self.blocks], "counterbalanced groups")
        self._check_analysis(names["questions"])

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of all factors, in order of appearance."""
        parts: list[Any] = [*self.stimuli, *self.blocks, *self.questions]
        return tuple(dict.fromkeys(factor for part in parts for factor in part.levels))

    def stimulus(self, name: str) -> Stimulus:
        """The stimulus of this name."""
        return next(part for part in self.stimuli if part.name == name)

    def question(self, name: str) -> Question:
        """The question of this name."""
        return next(part for part in self.questions if part.name == name)

    def block(self, name: str) -> Block:
        """The block of this name."""
        return next(part for part in self.blocks if part.name == name)

    def _parts(self) -> dict[str, Any]:
        return {"stimuli": self.stimuli, "questions": self.questions, "blocks": self.blocks}

    def _check_analysis(self, questions: list[str]) -> None:
        chosen = (self.analysis.choice,) if self.analysis.choice else ()
        _known((*chosen, *self.analysis.rated), questions, "analysis: questions")
        condition = (self.analysis.condition,) if self.analysis.condition else ()
        strength = (self.analysis.strength,) if self.analysis.strength else ()
        factors = (*condition, *strength, *self.analysis.within, *self.analysis.only)
        truths = tuple(question.truth for question in self.questions if question.truth)
        _known((*factors, *truths), list(self.factors), "factors")
        # The table of answers has columns of these names, and one for each factor beside them.
        taken = {"participant", "trial", "answer", "question", "block", "correct", "right", "stimulus", "scored"}
        if clash := taken & set(self.factors):
            raise MismatchError(
                f"factors: expected names other than those of columns, got {sorted(clash)}; rename them"
            )


def right_answer(question: Question, stimulus: Stimulus, levels: Mapping[str, str]) -> str:
    """The right answer to a question about a stimulus; empty where there is none."""
    if question.truth:
        return levels.get(question.truth, "")
    if question.kind == "yes-no":
        return "no" if stimulus.kind == "silence" else "yes"
    if question.kind == "same-different" and stimulus.members:
        return "same" if stimulus.members[0] == stimulus.members[1] else "different"
    return ""


def _known(asked: tuple[str, ...], known: list[str], what: str) -> None:
    if unknown := [name for name in asked if name not in known]:
        raise MismatchError(f"{what}: expected names among {', '.join(known) or 'none'}, got {unknown[0]!r}")
