"""The ladder of an adaptive block: its strengths, and the stimuli that share one."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.design.blocks import Block
from midair.study.design.stimulus import right_answer
from midair.study.design.study_design import Design

Array = NDArray[np.float64]


def stimulus_levels(design: Design, block: Block) -> tuple[list[tuple[str, ...]], Array]:
    """Stimuli of an adaptive block from weak to strong, those of one strength together, and the strengths.

    Within a strength they are in the order of their right answers, so that the same place means the same side.

    Raises
    ------
    InputError
        If a strength is not a number above 0.
    """
    try:
        strength = [float(design.stimulus(name).levels[block.strength]) for name in block.stimuli]
    except (KeyError, ValueError) as wrong:
        raise InputError(f"block {block.name!r}: expected a number for the factor {block.strength!r}") from wrong
    if not all(0 < one < np.inf for one in strength):
        raise InputError(f"block {block.name!r}: expected strengths above 0, got {strength}")
    steps = sorted(set(strength))
    order = sorted(range(len(strength)), key=lambda index: _right(design, block, block.stimuli[index]))
    return [tuple(block.stimuli[i] for i in order if strength[i] == step) for step in steps], np.array(steps)


def check_sides(design: Design, block: Block) -> None:
    """Raise InputError if a strength tells the right answer, or one answer is right in every trial of the block."""
    ladder, strength = stimulus_levels(design, block)
    if len(ladder) < 3:
        raise InputError(f"block {block.name!r}: expected three strengths or more, got {strength.tolist()}")
    rights = [[_right(design, block, name) for name in rung] for rung in ladder]
    if any(right != rights[0] for right in rights):
        raise InputError(
            f"block {block.name!r}: expected the same right answers at every strength, got "
            f"{', '.join(rights[0])} at the weakest and others elsewhere; list each strength once for each of them"
        )
    catches = [name for extra in block.extras if extra.role == "catch" for name in extra.stimuli]
    if len({*rights[0], *(_right(design, block, name) for name in catches)}) < 2:
        raise InputError(
            f"block {block.name!r}: expected trials with different right answers, got {rights[0][0]!r} in all of them; "
            "list each strength once for every answer (left and right, first and second), or add catch trials"
        )


def _right(design: Design, block: Block, name: str) -> str:
    stimulus = design.stimulus(name)
    return right_answer(design.question(block.questions[0]), stimulus, {**stimulus.levels, **block.levels})
