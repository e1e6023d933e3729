"""Blocks with a strength: the stimulus of the next adaptive trial, and the threshold of each participant."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from pandas import DataFrame

from midair.errors import InputError
from midair.study.design.plan import Plan, Staircase, Trial, correct_answer, stimulus_levels
from midair.study.design.session_state import SessionState, answer_exclusion, answers_table, excluded_participants
from midair.study.design.study_design import Block, Design
from midair.study.statistics.psychometric import PsychometricFit, fit_psychometric, next_level


def next_stimulus(plan: Plan, progress: SessionState, trial: Trial) -> str:
    """Name of the stimulus of a trial: fixed by the plan, or chosen from the earlier answers of its block."""
    drawn = trial.stimulus or progress.chosen.get(trial.code, "")
    if drawn:
        return drawn
    block = plan.design.block(trial.block)
    groups, levels = stimulus_levels(plan.design, block)
    top = len(groups) - 1
    if block.adaptive == "staircase":
        # Over level indices from the strongest; steps of two until the first reversal, then one.
        state = Staircase(level=top, steps=(2, 1), low=0, high=top)
        for _, correct in scored_history(plan, progress, block):
            state = state.answered(correct)
        index = round(state.level)
    else:
        correct, total = np.zeros((2, len(levels)))
        for _, level, right in _history(plan, progress, block):
            correct[level] += right
            total[level] += 1
        guess = guess_rate(plan.design, block)
        index = next_level(levels, correct, total, guess=0.1 if guess is None else guess)
    return groups[index][trial.variant % len(groups[index])]


def thresholds_of(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame | None:
    """Thresholds of every scored block with a strength in every session; None if the plan has no such block.

    A threshold uses the scored rows of `answers_table`, so that exports and reports have the same trials. It is that of
    `fit_psychometric` with the lapse limit of the plan. Columns: participant, block, method ("constant" without
    adaptive levels), threshold, low, high (95 % limits), strongest (level), trials (answers in the fit), false_alarms
    (NaN unless estimated), lapse, p_misfit, note. Where a threshold is excluded or refused, `note` gives the reason and
    threshold, low and high are NaN; threshold is inf or -inf where it is above or below the levels.
    """
    blocks = [block for block in plan.design.blocks if block.strength and block.scored]
    if not blocks or not sessions:
        return None
    table = answers_table(plan, sessions)
    rules = excluded_participants(plan, sessions).drop_duplicates("participant").set_index("participant")["rule"]
    rows: list[dict[str, Any]] = []
    for session in sessions:
        number = session.trials[0].participant
        who = f"sub-{number:02d}"
        for block in blocks:
            row: dict[str, Any] = {"participant": who, "block": block.name, "method": block.adaptive or "constant"}
            row |= dict.fromkeys(("threshold", "low", "high"), np.nan)
            row |= {"strongest": stimulus_levels(plan.design, block)[1][-1], "trials": 0}
            row |= dict.fromkeys(("false_alarms", "lapse", "p_misfit"), np.nan)
            asked = table.empty or (table["participant"] == who) & (table["block"] == block.name)
            given = table if table.empty else table.loc[asked & (table["question"] == block.questions[0])]
            used = given if given.empty else given.loc[given["scored"].to_numpy(bool)]
            if used.empty:
                rule = f"the rule '{rules[who]}' of the plan excludes the participant" if who in rules else ""
                none = f"the rules of the plan exclude all {len(given)} answers" if len(given) else "no answers"
                rows.append(row | {"note": rule or none})
                continue
            try:
                fit, trials = _fitted(plan.design, block, used, np.random.default_rng([plan.design.seed, number]))
            except InputError as wrong:
                rows.append(row | {"note": f"refused: {wrong}"})
                continue
            guessed = fit.function.guess if guess_rate(plan.design, block) is None else np.nan
            row |= {"trials": trials, "false_alarms": guessed, "lapse": fit.function.lapse, "p_misfit": fit.p_misfit}
            row |= {"threshold": fit.ranked, "note": fit.refusal}
            rows.append(row if fit.refusal else row | {"low": fit.low, "high": fit.high})
    return DataFrame(rows)


def guess_rate(design: Design, block: Block) -> float | None:
    """Chance of a correct answer without a stimulus, 1/m with m alternatives.

    None if one answer, such as "yes", is correct at all levels: the false-alarm rate is then estimated.
    """
    groups, _ = stimulus_levels(design, block)
    if len({correct_answer(design, block, name) for name in groups[0]}) == 1:
        return None
    return 1 / max(len(design.question(block.questions[0]).answers), 2)


def _fitted(design: Design, block: Block, used: DataFrame, rng: np.random.Generator) -> tuple[PsychometricFit, int]:
    """Fit of one participant's scored answers, and their number.

    Stimuli outside the levels are blanks: level 0 where false alarms are estimated, else without use.
    """
    groups, levels = stimulus_levels(design, block)
    level_of = {name: level for names, level in zip(groups, levels, strict=True) for name in names}
    guess = guess_rate(design, block)
    signal = correct_answer(design, block, groups[0][0])
    pairs = [
        (level_of.get(name, 0.0), answer == (signal if guess is None else correct_answer(design, block, name)))
        for name, answer in zip(used["stimulus"].tolist(), used["answer"].tolist(), strict=True)
        if guess is None or name in level_of
    ]
    level, counted = np.array(pairs, float).reshape(-1, 2).T
    fit = fit_psychometric(
        level, counted, np.ones(len(level)), rng=rng, guess=guess, lapse_most=design.analysis.lapse_most
    )
    return fit, len(level)


def threshold_cautions(design: Design) -> list[str]:
    """One sentence for each adaptive block whose thresholds may be biased, see docs/decisions/0036."""
    return [
        f"block {block.name}: expected trials at the strongest level beside the adaptive ones (extras with the role "
        "attention, 60 in the template detection), got none; without them a lapse cannot be told from a flat slope"
        for block in design.blocks
        if block.adaptive
        and all(extra.role != "attention" for extra in block.extras)
        and guess_rate(design, block) is not None
    ]


def _history(plan: Plan, progress: SessionState, block: Block) -> Iterator[tuple[Trial, int, bool]]:
    """Each trial of a block at one of its levels so far, with the index of the level and whether it is correct.

    Answers that the plan excludes are left out.
    """
    groups, _ = stimulus_levels(plan.design, block)
    level_index = {name: index for index, names in enumerate(groups) for name in names}
    for trial in progress.trials:
        given = progress.answers.get((trial.code, block.questions[0]))
        if trial.block != block.name or given is None or not (trial.scored or not block.scored):
            continue
        name = trial.stimulus or progress.chosen[trial.code]
        if name in level_index and not answer_exclusion(plan, progress, trial.code, given):
            yield trial, level_index[name], given.answer == correct_answer(plan.design, block, name)


def scored_history(plan: Plan, progress: SessionState, block: Block) -> list[tuple[int, bool]]:
    """Test trials of an adaptive block as (level, correct), without the answers that the plan excludes."""
    return [(level, right) for trial, level, right in _history(plan, progress, block) if trial.role == "test"]
