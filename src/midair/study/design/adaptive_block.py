"""Adaptive blocks: the stimulus of the next trial and the threshold, computed from the answers so far."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.study.design.adaptive import QuestPlus, Staircase
from midair.study.design.adaptive_levels import stimulus_levels
from midair.study.design.blocks import Block
from midair.study.design.exclusions import answer_exclusion, participant_exclusion
from midair.study.design.plan import Plan, Trial
from midair.study.design.session_state import SessionState
from midair.study.design.stimulus import right_answer
from midair.study.design.study_design import Design

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

Array = NDArray[np.float64]
History = list[tuple[int, bool]]
"""Index of the stimulus level and whether the answer was correct, in order of presentation."""


def next_stimulus(plan: Plan, progress: SessionState, trial: Trial) -> str:
    """Name of the stimulus of a trial: fixed by the plan, or chosen from the earlier answers of its block."""
    drawn = trial.stimulus or progress.chosen.get(trial.code, "")
    if drawn:
        return drawn
    block = plan.design.block(trial.block)
    groups, strength = stimulus_levels(plan.design, block)
    history = scored_history(plan, progress, block)
    if block.adaptive == "staircase":
        group = groups[round(run_staircase(len(groups), history).level)]
    else:
        level = run_quest(plan.design, block, history).next_level
        group = groups[int(np.argmin(np.abs(strength - level)))]
    return group[trial.variant % len(group)]


def threshold(plan: Plan, progress: SessionState, block_name: str) -> tuple[float, float]:
    """Threshold of one participant from an adaptive block and its standard deviation, in the unit of the levels.

    QUEST+: mean and standard deviation of the posterior. Staircase: mean level of the last six reversals; NaN for the
    deviation. The exclusion rules apply. Raises InputError if the block is not adaptive or not finished, has no valid
    answers, or if a staircase has fewer than six reversals.
    """
    block = plan.design.block(block_name)
    if not block.adaptive:
        raise InputError(f"block {block_name!r}: expected an adaptive block, got order {block.order!r}")
    if rule := participant_exclusion(plan, progress):
        raise InputError(f"excluded by a rule of the plan, {rule}")
    tests = [trial for trial in progress.trials if trial.block == block_name and trial.role == "test"]
    due = sum((trial.code, block.questions[0]) not in progress.answers for trial in tests)
    if due:
        raise InputError(f"not finished: expected {block.repetitions} answers, got {block.repetitions - due}")
    groups, strength = stimulus_levels(plan.design, block)
    history = scored_history(plan, progress, block)
    if not history:
        raise InputError(f"the rules of the plan exclude all {block.repetitions} answers of the block")
    if block.adaptive == "quest+":
        return run_quest(plan.design, block, history).threshold
    state = run_staircase(len(groups), history)
    # Called for its check only: the mean is taken over the strengths, not over their indices.
    state.threshold(last=6)
    return float(np.mean(strength[np.rint(state.turned[-6:]).astype(int)])), float("nan")


def thresholds_of(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame | None:
    """Thresholds of every adaptive block in every session; None if the plan has no such block.

    Columns participant, block, threshold, sd, note; where a threshold cannot be computed or is excluded, it is NaN and
    `note` gives the reason.
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


def scored_history(plan: Plan, progress: SessionState, block: Block) -> History:
    """Test trials of an adaptive block as (level, correct), without the answers that the plan excludes."""
    groups, _ = stimulus_levels(plan.design, block)
    level_index = {name: index for index, names in enumerate(groups) for name in names}
    question = plan.design.question(block.questions[0])
    history: History = []
    for trial in progress.trials:
        name = trial.stimulus or progress.chosen.get(trial.code, "")
        given = progress.answers.get((trial.code, question.name))
        if trial.block != block.name or trial.role != "test" or name not in level_index or given is None:
            continue
        if not answer_exclusion(plan, progress, trial.code, given):
            stimulus = plan.design.stimulus(name)
            right = right_answer(question, stimulus, {**stimulus.levels, **trial.levels})
            history.append((level_index[name], given.answer == right))
    return history


def run_staircase(count: int, history: History) -> Staircase:
    """3-down/1-up staircase over level indices, from the strongest; steps of two until the first reversal, then one."""
    top = count - 1
    state = Staircase(level=top, steps=(2, 1), low=0, high=top)
    for _, correct in history:
        state = state.answered(correct)
    return state


def run_quest(design: Design, block: Block, history: History) -> QuestPlus:
    """QUEST+ with Weibull functions around the levels of the block, after the answers so far."""
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
    for index, correct in history:
        state = state.answered(float(strength[index]), correct)
    return state
