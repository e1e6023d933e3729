"""Blocks: trials that belong together, in the order that is promised, and what is strewn among them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import one_of

StopGuard = Literal["shuffle", "rounds", "fixed"]
"""All trials of a block mixed; every stimulus once, in a new order, repetition by repetition; as written."""

Adaptive = Literal["", "staircase", "quest+"]
"""A plan drawn beforehand; 3-down/1-up; QUEST+."""

ExtraRole = Literal["catch", "anchor", "attention"]
"""A trial in which nothing (or nothing else) is to be felt; an end of the scale; one that whoever attends answers
rightly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extra:
    """Trials of another purpose that are strewn among those of a block, never the first of it.

    Attributes
    ----------
    role : {"catch", "anchor", "attention"}
        What they are for.
    stimuli : tuple of str
        Names.
    repetitions : int
        Trials of each stimulus.
    questions : tuple of str
        Names; those of the block if empty.
    """

    role: ExtraRole
    stimuli: tuple[str, ...]
    repetitions: int = 1
    questions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        one_of(self.role, ExtraRole, "extras: role")
        if not self.stimuli or self.repetitions < 1:
            raise InputError(f"extras: expected stimuli and repetitions of 1 or more, got {self.repetitions}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """When a training is over: a share of the last answers to the first question is right.

    Attributes
    ----------
    right : float
        Least share, above 0 to 1.
    last : int
        Of so many answers.
    """

    right: float
    last: int

    def __post_init__(self) -> None:
        if not 0 < self.right <= 1 or self.last < 1:
            raise InputError(f"criterion: expected right in 0 to 1, last of 1 or more, got {self.right:g}, {self.last}")


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
        Factor whose levels are the strengths of an adaptive block's stimuli, as numbers. Where several stimuli share a
        strength (left and right), which of them comes is drawn beforehand, each equally often.
    extras : tuple of Extra
        Trials strewn among these: catch trials, anchors, attention checks.
    criterion : Criterion, optional
        Ends the block as soon as it is met; `repetitions` is then the most there can be.
    feedback : bool
        Whether the participant is told after each trial what was right.
    break_every : int
        A break of `rest_s` after so many trials within the block; 0 for none.
    jitter_s : tuple of float
        Shortest and longest time before each stimulus, in s; drawn beforehand.
    session : int
        Number of the session that the block belongs to, from 1 on.
    """

    name: str
    stimuli: tuple[str, ...]
    questions: tuple[str, ...]
    repetitions: int = 1
    order: StopGuard = "shuffle"
    longest_run: int = 0
    group: str = ""
    scored: bool = True
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    text: str = ""
    rest_s: float = 0.0
    adaptive: Adaptive = ""
    strength: str = ""
    extras: tuple[Extra, ...] = ()
    criterion: Criterion | None = None
    feedback: bool = False
    break_every: int = 0
    jitter_s: tuple[float, float] = (0.0, 0.0)
    session: int = 1

    def __post_init__(self) -> None:
        one_of(self.order, StopGuard, f"block {self.name!r}: order")
        one_of(self.adaptive, Adaptive, f"block {self.name!r}: adaptive")
        if bool(self.adaptive) != bool(self.strength) or (self.adaptive and len(self.stimuli) < 3):
            raise InputError(f"block {self.name!r}: expected adaptive, strength and three stimuli or more, or neither")
        if not self.stimuli or self.repetitions < 1 or self.longest_run < 0 or self.rest_s < 0:
            raise InputError(
                f"block {self.name!r}: expected stimuli, repetitions of 1 or more, longest_run and rest_s of 0 or more"
            )
        if not 0 <= self.jitter_s[0] <= self.jitter_s[1] < float("inf"):
            raise InputError(f"block {self.name!r}: expected jitter_s from short to long, got {list(self.jitter_s)}")
        if self.break_every < 0 or (self.break_every and not self.rest_s) or self.session < 1:
            raise InputError(
                f"block {self.name!r}: expected break_every of 0 or more with a rest_s, and session of 1 or more"
            )
        if not self.group:
            object.__setattr__(self, "group", self.name)
