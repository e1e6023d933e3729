"""Blocks of trials, their order, and extra trials inserted among them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from midair.errors import InputError
from midair.study.design.question import one_of

BlockOrder = Literal["shuffle", "rounds", "fixed"]
"""All trials of a block shuffled; every stimulus once per repetition, shuffled anew in each; as listed."""

Adaptive = Literal["", "staircase", "quest+"]
"""Stimuli fixed by the plan; 3-down/1-up staircase; QUEST+."""

ExtraRole = Literal["catch", "anchor", "attention"]
"""A trial without a stimulus or difference; an end of the rating scale; a trial that every attentive participant
answers correctly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extra:
    """Extra trials inserted at random positions of a block, never the first one."""

    role: ExtraRole
    stimuli: tuple[str, ...]
    repetitions: int = 1
    """Trials of each stimulus."""
    questions: tuple[str, ...] = ()
    """Names of the questions; those of the block if empty."""

    def __post_init__(self) -> None:
        one_of(self.role, ExtraRole, "extras: role")
        if not self.stimuli or self.repetitions < 1:
            raise InputError(f"extras: expected stimuli and repetitions of 1 or more, got {self.repetitions}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """Criterion that ends a training block: share of correct answers to the first question."""

    right: float
    """Least share of correct answers, above 0 to 1."""
    last: int
    """Number of latest answers over which the share is computed."""

    def __post_init__(self) -> None:
        if not 0 < self.right <= 1 or self.last < 1:
            raise InputError(f"criterion: expected right in 0 to 1, last of 1 or more, got {self.right:g}, {self.last}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A sequence of trials with the same questions."""

    name: str
    stimuli: tuple[str, ...]
    questions: tuple[str, ...]
    repetitions: int = 1
    """Trials of each stimulus; in an adaptive block the number of all trials; with a criterion the maximum."""
    order: BlockOrder = "shuffle"
    longest_run: int = 0
    """Largest number of trials with the same stimulus in a row; 0 for no limit."""
    group: str = ""
    """Group of consecutive blocks, the unit of `Design.counterbalanced`; the name of the block if empty."""
    scored: bool = True
    """Whether the answers are analysed; false for familiarisation."""
    levels: Mapping[str, str] = field(default_factory=dict[str, str])
    """Factor levels of all trials of the block."""
    text: str = ""
    """Instruction shown before the first trial."""
    rest_s: float = 0.0
    """Shortest break after the block, in s."""
    adaptive: Adaptive = ""
    """Method that chooses the stimuli from the answers to the first question."""
    strength: str = ""
    """Factor with the numeric stimulus strength of an adaptive block. If several stimuli share a strength (left and
    right), the plan draws each equally often."""
    extras: tuple[Extra, ...] = ()
    """Catch trials, anchors and attention checks."""
    criterion: Criterion | None = None
    """Ends the block as soon as it is met."""
    feedback: bool = False
    """Whether the correct answer is shown after each trial."""
    break_every: int = 0
    """Number of trials between breaks of `rest_s` within the block; 0 for none."""
    jitter_s: tuple[float, float] = (0.0, 0.0)
    """Shortest and longest time before each stimulus, in s; drawn with the plan."""
    session: int = 1
    """Session number, from 1."""

    def __post_init__(self) -> None:
        one_of(self.order, BlockOrder, f"block {self.name!r}: order")
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
