"""Table of the answers of a study, with the condition of each trial."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any

from midair.errors import BrokenFileError
from midair.study.design.exclusions import answer_exclusion, participant_exclusion
from midair.study.design.session_state import right_answer_of_trial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

    from midair.study.design.plan import Plan, Trial
    from midair.study.design.session_state import SessionState


def answers_table(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Table of all valid answers, without those to private questions (they stay in the log).

    Returns
    -------
    DataFrame
        One row per answer, in the order of asking, with columns participant, session, trial, block, group, repetition,
        stimulus, role, scored, excluded (rule of the plan that excludes the answer or its participant; excluded answers
        are not scored), question, kind, answer, right (correct answer), correct (1, 0, or -1 for questions without a
        correct answer), reaction_s, reaction_by, failed_plays, time (s from the beginning of the session), simulated,
        one column per question of the form, and one per factor, "n/a" where a factor has no level.
    """
    from pandas import DataFrame

    rows: list[dict[str, Any]] = []
    for session in sessions:
        out = participant_exclusion(plan, session)
        rows += [
            _answer_row(plan, session, trial, name, out)
            for trial in session.trials
            for name in trial.questions
            if (trial.code, name) in session.answers and not plan.design.question(name).private
        ]
    return DataFrame(rows)


def _answer_row(plan: Plan, session: SessionState, trial: Trial, name: str, out: str) -> dict[str, Any]:
    question = plan.design.question(name)
    given = session.answers[trial.code, name]
    stimulus = plan.design.stimulus(trial.stimulus or session.chosen[trial.code])
    levels = {**stimulus.levels, **trial.levels, **question.levels}
    right = right_answer_of_trial(plan, trial, session.chosen, name)
    why = answer_exclusion(plan, session, trial.code, given) or out
    row: dict[str, Any] = {
        "participant": f"sub-{trial.participant:02d}",
        "session": trial.session,
        "trial": trial.number,
        "block": trial.block,
        "group": trial.group,
        "repetition": trial.repetition,
        "stimulus": stimulus.name,
        "role": trial.role,
        "scored": trial.scored and not why,
        "excluded": why or "n/a",
        "question": name,
        "kind": question.kind,
        "answer": given.answer,
        "right": right or "n/a",
        "correct": int(given.answer == right) if right and not given.late else -1,
        "reaction_s": given.reaction_s,
        "reaction_by": given.by or "n/a",
        "failed_plays": session.failed.get(trial.code, 0),
        "time": seconds_between(session.began.get(trial.session, given.time), given.time),
        "simulated": session.simulated,
    }
    asked = (plan.design.question(each) for each in plan.design.form)
    form = {each.name: session.form.get(each.name, "n/a") for each in asked if not each.private}
    return row | form | {factor: levels.get(factor, "n/a") for factor in plan.design.factors}


def seconds_between(begin: str, end: str) -> float:
    """Time between two ISO 8601 times, in s."""
    try:
        return round((datetime.fromisoformat(end) - datetime.fromisoformat(begin)).total_seconds(), 3)
    except (ValueError, TypeError) as wrong:
        raise BrokenFileError(f"log: expected dates and times, got {begin[:40]!r} and {end[:40]!r}") from wrong
