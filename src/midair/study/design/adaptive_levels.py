"""Stimulus levels of an adaptive block, and the stimuli that share a level."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.design.blocks import Block
from midair.study.design.stimulus import right_answer
from midair.study.design.study_design import Design

Array = NDArray[np.float64]


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
