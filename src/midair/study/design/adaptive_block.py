"""Blocks whose stimuli follow the answers: which rung of a ladder comes next, and the threshold in the end. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.design.adaptive import QuestPlus, Staircase
from midair.study.design.adaptive_levels import stimulus_levels
from midair.study.design.blocks import Block
from midair.study.design.exclusions import why_answer_left_out, why_left_out
from midair.study.design.plan import Plan, Trial
from midair.study.design.session_state import SessionState
from midair.study.design.stimulus import right_answer
from midair.study.design.study_design import Design

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]
History = list[tuple[int, bool]]
"""Rung and whether the answer was right, in order."""


def next_stimulus(plan: Plan, progress: SessionState, trial: Trial) -> str:
    """Name of the stimulus of a trial; drawn already, or chosen from the answers so far of its block."""
    drawn = trial.stimulus or progress.chosen.get(trial.code, "")
    if drawn:
        return drawn
    block = plan.design.block(trial.block)
    ladder, strength = stimulus_levels(plan.design, block)
    history = answered(plan, progress, block)
    if block.adaptive == "staircase":
        rung = ladder[round(climb(len(ladder), history).level)]
    else:
        level = ask_quest(plan.design, block, history).next_level
        rung = ladder[int(np.argmin(np.abs(strength - level)))]
    return rung[trial.variant % len(rung)]


def threshold(plan: Plan, progress: SessionState, block_name: str) -> tuple[float, float]:
    """Threshold of one participant from an adaptive block, and its standard deviation, in the unit of the strengths.

    From QUEST+ mean and deviation of the posterior; from a staircase the mean of the strengths at the last six
    reversals (NaN for the deviation). The rules of the plan leave out people and answers here as everywhere.

    Raises
    ------
    InputError
        If the block is not adaptive or not finished, if a rule of the plan leaves out the participant or every answer
        of the block, or if a staircase turned fewer than six times.
    """
    block = plan.design.block(block_name)
    if not block.adaptive:
        raise InputError(f"block {block_name!r}: expected an adaptive block, got order {block.order!r}")
    if rule := why_left_out(plan, progress):
        raise InputError(f"left out by a rule of the plan, {rule}")
    tests = [trial for trial in progress.trials if trial.block == block_name and trial.role == "test"]
    due = sum((trial.code, block.questions[0]) not in progress.answers for trial in tests)
    if due:
        raise InputError(f"not finished: expected {block.repetitions} answers, got {block.repetitions - due}")
    ladder, strength = stimulus_levels(plan.design, block)
    history = answered(plan, progress, block)
    if not history:
        raise InputError(f"rules of the plan leave out all {block.repetitions} answers of the block")
    if block.adaptive == "quest+":
        return ask_quest(plan.design, block, history).threshold
    state = climb(len(ladder), history)
    # For its check alone: the mean is of strengths, not of rungs.
    state.threshold(last=6)
    return float(np.mean(strength[np.rint(state.turned[-6:]).astype(int)])), float("nan")


def thresholds_of(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame | None:
    """Thresholds of every adaptive block of every session; None if the plan has no such block.

    Columns participant, block, threshold, sd, note; a threshold that cannot be computed, or that the rules of the plan
    leave out, is NaN, and the note says why.
    """
    from pandas import DataFrame

    blocks = [block.name for block in plan.design.blocks if block.adaptive and block.scored]
    rows: list[dict[str, Any]] = []
    for session in sessions:
        for name in blocks:
            row = {"participant": f"sub-{session.trials[0].participant:02d}", "block": name}
            try:
                mean, sd = threshold(plan, session, name)
            except InputError as wrong:
                rows.append(row | {"threshold": np.nan, "sd": np.nan, "note": str(wrong)})
            else:
                rows.append(row | {"threshold": mean, "sd": sd, "note": ""})
    return DataFrame(rows) if rows else None


def answered(plan: Plan, progress: SessionState, block: Block) -> History:
    """The answers of a block to its first question, as right or wrong.

    Without those to catch trials and such, and without those that a rule of the plan leaves out, as in `answers_table`.
    """
    ladder, _ = stimulus_levels(plan.design, block)
    place = {name: rung for rung, names in enumerate(ladder) for name in names}
    question = plan.design.question(block.questions[0])
    history: History = []
    for trial in progress.trials:
        name = trial.stimulus or progress.chosen.get(trial.code, "")
        given = progress.answers.get((trial.code, question.name))
        if trial.block != block.name or trial.role != "test" or name not in place or given is None:
            continue
        if not why_answer_left_out(plan, progress, trial.code, given):
            stimulus = plan.design.stimulus(name)
            right = right_answer(question, stimulus, {**stimulus.levels, **trial.levels})
            history.append((place[name], given.answer == right))
    return history


def climb(count: int, history: History) -> Staircase:
    """A 3-down/1-up staircase over the rungs, from the strongest, two rungs a step until the first reversal."""
    top = count - 1
    state = Staircase(level=top, steps=(2, 1), low=0, high=top)
    for _, correct in history:
        state = state.answered(correct)
    return state


def ask_quest(design: Design, block: Block, history: History) -> QuestPlus:
    """QUEST+ over a grid of Weibull functions around the ladder's strengths, after the answers so far."""
    _, strength = stimulus_levels(design, block)
    question = design.question(block.questions[0])
    guess = 0.05 if question.kind == "yes-no" else 1 / max(len(question.answers), 2)
    state = QuestPlus(
        levels=strength,
        thresholds=np.geomspace(strength[0] / 2, strength[-1] * 2, 41),
        slopes=np.array([1.0, 2.0, 4.0, 8.0]),
        lapses=np.array([0.02]),
        guess=guess,
    )
    for rung, correct in history:
        state = state.answered(float(strength[rung]), correct)
    return state
