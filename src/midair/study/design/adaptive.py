"""Adaptive blocks: a staircase (Levitt, 1971) as an immutable state, and the levels of a block."""

from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.study.design.question import right_answer
from midair.study.design.study_design import Block, Design


@dataclass(frozen=True, slots=True, kw_only=True)
class Staircase:
    """Level that goes down after `down` correct answers in a row and up after one wrong answer.

    With `down` = 3 it converges to 79.4 % correct answers (0.5^(1/3)).
    """

    level: float
    """Level of the next trial."""
    steps: tuple[float, ...]
    """Step sizes: the first until the first reversal, the second until the second, the last for all later trials."""
    down: int = 3
    """Correct answers in a row before the level goes down."""
    low: float = -np.inf
    high: float = np.inf
    row: int = 0
    """Correct answers since the last change."""
    moves: tuple[int, ...] = ()
    """Direction of each change so far, -1 or 1."""
    turned: tuple[float, ...] = ()
    """Levels of the reversals."""

    def __post_init__(self) -> None:
        if not self.steps or min(self.steps) <= 0 or self.down < 1:
            raise InputError(f"staircase: expected steps above 0 and down of 1 or more, got {self.steps}, {self.down}")
        if not self.low <= self.level <= self.high:
            raise InputError(f"staircase: expected a level within {self.low:g} to {self.high:g}, got {self.level:g}")

    def answered(self, correct: bool) -> "Staircase":
        """State after one answer."""
        if correct and self.row + 1 < self.down:
            return replace(self, row=self.row + 1)
        move = -1 if correct else 1
        # A reversal is counted at the level before the change.
        turns = (*self.turned, self.level) if self.moves and self.moves[-1] != move else self.turned
        step = self.steps[min(len(turns), len(self.steps) - 1)]
        level = float(np.clip(self.level + move * step, self.low, self.high))
        return replace(self, level=level, row=0, moves=(*self.moves, move), turned=turns)

    def threshold(self, *, last: int = 6) -> float:
        """Mean level of the last reversals; raises InputError if there are fewer than `last`."""
        if len(self.turned) < last or last < 1:
            raise InputError(f"staircase: expected {last} or more reversals, got {len(self.turned)}; run more trials")
        return float(np.mean(self.turned[-last:]))


def stimulus_levels(design: Design, block: Block) -> tuple[list[tuple[str, ...]], Array]:
    """Stimuli of an adaptive block grouped by strength from weak to strong, and the strengths.

    Within a group, stimuli are sorted by their correct answers, so that the same index means the same side at every
    strength. Raises InputError if a strength is not a number above 0.
    """
    try:
        strength = [float(design.stimulus(name).levels[block.strength]) for name in block.stimuli]
    except (KeyError, ValueError) as wrong:
        raise InputError(f"block {block.name!r}: expected a number for the factor {block.strength!r}") from wrong
    if not all(0 < one < np.inf for one in strength):
        raise InputError(f"block {block.name!r}: expected strengths above 0, got {strength}")
    steps = sorted(set(strength))
    order = sorted(range(len(strength)), key=lambda index: correct_answer(design, block, block.stimuli[index]))
    return [tuple(block.stimuli[i] for i in order if strength[i] == step) for step in steps], np.array(steps)


def check_sides(design: Design, block: Block) -> None:
    """Raise InputError if the strength gives the correct answer away, or if one answer is correct in all trials."""
    groups, strength = stimulus_levels(design, block)
    if len(groups) < 3:
        raise InputError(f"block {block.name!r}: expected three strengths or more, got {strength.tolist()}")
    rights = [[correct_answer(design, block, name) for name in group] for group in groups]
    if any(right != rights[0] for right in rights):
        raise InputError(
            f"block {block.name!r}: expected the same correct answers at every strength, got "
            f"{', '.join(rights[0])} at the lowest strength and others elsewhere; list each strength once per answer"
        )
    catches = [name for extra in block.extras if extra.role == "catch" for name in extra.stimuli]
    if len({*rights[0], *(correct_answer(design, block, name) for name in catches)}) < 2:
        raise InputError(
            f"block {block.name!r}: expected trials with different correct answers, got {rights[0][0]!r} in all; "
            "list each strength once for every answer (left and right, first and second), or add catch trials"
        )


def correct_answer(design: Design, block: Block, name: str) -> str:
    """Correct answer to the first question of a block about a stimulus; empty if it has none."""
    stimulus = design.stimulus(name)
    return right_answer(design.question(block.questions[0]), stimulus, {**stimulus.levels, **block.levels})
