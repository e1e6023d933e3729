"""Adaptive blocks: the stimulus of the next trial and the threshold, computed from the answers so far."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from midair.array_types import Array
from midair.study.design.plan import Plan, Staircase, Trial, correct_answer, stimulus_levels
from midair.study.design.session_state import SessionState, answer_exclusion, answers_table, excluded_participants
from midair.study.design.study_design import Block, Design
from midair.study.statistics import ThresholdModel


def next_stimulus(plan: Plan, progress: SessionState, trial: Trial) -> str:
    """Name of the stimulus of a trial: fixed by the plan, or chosen from the earlier answers of its block."""
    drawn = trial.stimulus or progress.chosen.get(trial.code, "")
    if drawn:
        return drawn
    block = plan.design.block(trial.block)
    groups, _ = stimulus_levels(plan.design, block)
    if block.adaptive == "staircase":
        # Over level indices from the strongest; steps of two until the first reversal, then one.
        top = len(groups) - 1
        state = Staircase(level=top, steps=(2, 1), low=0, high=top)
        for _, correct in scored_history(plan, progress, block):
            state = state.answered(correct)
        index = round(state.level)
    else:
        model = threshold_model(plan.design, block, coarse=True)
        given = [(name, answer) for _, name, answer in _valid_answers(plan, progress, block)]
        counts = answer_counts(plan.design, block, model, given)
        index = int(model.next_level(model.posterior(*counts)))
    return groups[index][trial.variant % len(groups[index])]


def thresholds_of(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame | None:
    """Thresholds of every adaptive block in every session; None if the plan has no such block.

    A threshold uses the scored rows of `answers_table`, so that exports and reports have the same trials. It is
    estimated by `ThresholdModel`, with the levels of the block and the lapse limit of the plan. Columns: participant,
    block, threshold, sd, low, high (95 % limits), strongest (level), trials (analysed answers), bias, lapse, p_misfit,
    note. Where a threshold is excluded or refused, `note` gives the reason and threshold, sd, low and high are NaN;
    threshold is inf or -inf where it is above or below the levels.
    """
    blocks = [block for block in plan.design.blocks if block.adaptive and block.scored]
    if not blocks or not sessions:
        return None
    table = answers_table(plan, sessions)
    rules = excluded_participants(plan, sessions).drop_duplicates("participant").set_index("participant")["rule"]
    rows: list[dict[str, Any]] = []
    for session in sessions:
        number = session.trials[0].participant
        who = f"sub-{number:02d}"
        for block in blocks:
            row: dict[str, Any] = {"participant": who, "block": block.name}
            row |= dict.fromkeys(("threshold", "sd", "low", "high"), np.nan)
            asked = table.empty or (table["participant"] == who) & (table["block"] == block.name)
            given = table if table.empty else table.loc[asked & (table["question"] == block.questions[0])]
            used = given if given.empty else given.loc[given["scored"].to_numpy(bool)]
            row |= {"strongest": stimulus_levels(plan.design, block)[1][-1], "trials": len(used)}
            row |= dict.fromkeys(("bias", "lapse", "p_misfit"), np.nan)
            if used.empty:
                rule = f"the rule '{rules[who]}' of the plan excludes the participant" if who in rules else ""
                none = f"the rules of the plan exclude all {len(given)} answers" if len(given) else "no answers"
                rows.append(row | {"note": rule or none})
                continue
            model = threshold_model(plan.design, block)
            pairs = zip(used["stimulus"].tolist(), used["answer"].tolist(), strict=True)
            counts = answer_counts(plan.design, block, model, pairs)
            found = model.estimate(*counts, rng=np.random.default_rng([plan.design.seed, number]))
            row |= {"bias": found.bias, "lapse": found.lapse, "p_misfit": found.p_misfit}
            note = found.refusal(model.levels)
            row["threshold"] = found.ranked(model.levels)
            if not note:
                row |= {"sd": found.sd, "low": found.low, "high": found.high}
            rows.append(row | {"note": note})
    return DataFrame(rows)


def threshold_model(design: Design, block: Block, *, coarse: bool = False) -> ThresholdModel:
    """Model of the answers to the first question of an adaptive block."""
    groups, strength = stimulus_levels(design, block)
    answers = design.question(block.questions[0]).answers
    sides = len({correct_answer(design, block, name) for name in groups[0]})
    return ThresholdModel(
        task="detection" if sides == 1 else "two sides" if len(answers) == 2 else "choice",
        levels=strength,
        alternatives=max(len(answers), 2),
        lapse_most=design.analysis.lapse_most,
        coarse=coarse,
    )


def threshold_cautions(design: Design) -> list[str]:
    """One sentence for each adaptive block whose thresholds will be biased, see docs/decisions/0036."""
    return [
        f"block {block.name}: expected trials at the strongest level beside the adaptive ones (extras with the role "
        "attention, 60 in the template detection), got none; thresholds of a flat slope will be about 20 % too low"
        for block in design.blocks
        if block.adaptive
        and all(extra.role != "attention" for extra in block.extras)
        and threshold_model(design, block).task == "two sides"
    ]


def answer_counts(
    design: Design, block: Block, model: ThresholdModel, given: Iterable[tuple[str, str]]
) -> tuple[Array, Array]:
    """Counted and all answers in each cell of a model, from names of stimuli and answers to the first question.

    Stimuli outside the levels of the block are blanks; a choice has no cell for them.
    """
    groups, _ = stimulus_levels(design, block)
    level_index = {name: index for index, names in enumerate(groups) for name in names}
    first = correct_answer(design, block, groups[0][0])
    counted, total = np.zeros(model.cells), np.zeros(model.cells)
    for name, answer in given:
        blank = name not in level_index
        if blank and model.task == "choice":
            continue
        right = first if blank else correct_answer(design, block, name)
        cell = model.cells - 1 if blank else level_index[name]
        if model.task == "two sides" and not blank and right != first:
            cell += len(groups)
        total[cell] += 1
        counted[cell] += answer == (right if model.task == "choice" else first)
    return counted, total


def _valid_answers(plan: Plan, progress: SessionState, block: Block) -> list[tuple[Trial, str, str]]:
    """Each trial of a block so far with its stimulus and answer, without the answers that the plan excludes."""
    found: list[tuple[Trial, str, str]] = []
    for trial in progress.trials:
        given = progress.answers.get((trial.code, block.questions[0]))
        if trial.block != block.name or given is None or not (trial.scored or not block.scored):
            continue
        if not answer_exclusion(plan, progress, trial.code, given):
            found.append((trial, trial.stimulus or progress.chosen[trial.code], given.answer))
    return found


def scored_history(plan: Plan, progress: SessionState, block: Block) -> list[tuple[int, bool]]:
    """Test trials of an adaptive block as (level, correct), without the answers that the plan excludes."""
    groups, _ = stimulus_levels(plan.design, block)
    level_index = {name: index for index, names in enumerate(groups) for name in names}
    return [
        (level_index[name], answer == correct_answer(plan.design, block, name))
        for trial, name, answer in _valid_answers(plan, progress, block)
        if trial.role == "test" and name in level_index
    ]
