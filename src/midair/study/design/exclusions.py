"""Participants and answers that the exclusion rules of the plan leave out of the analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from midair.study.design.session_state import SessionState, right_answer_of_trial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

    from midair.study.design.plan import Plan
    from midair.study.design.session_state import GivenAnswer


def excluded_participants(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Participants whom a rule of the plan excludes.

    Returns
    -------
    DataFrame
        Columns participant, rule, value (measured), limit (allowed by the plan); no rows if all participants are
        analysed.
    """
    from pandas import DataFrame

    rows = [row for session in sessions for row in _violated_rules(plan, session)]
    return DataFrame(rows, columns=["participant", "rule", "value", "limit"])


def participant_exclusion(plan: Plan, session: SessionState) -> str:
    """First rule that excludes the participant of a session; empty if none does."""
    return next((f"participant: {row['rule']}" for row in _violated_rules(plan, session)), "")


def answer_exclusion(plan: Plan, session: SessionState, code: str, given: GivenAnswer) -> str:
    """Rule that excludes one answer; empty if none does."""
    rules = plan.design.exclusions
    if given.late:
        return "timeout"
    if given.reaction_s < rules.fastest_s:
        return "too fast"
    if rules.slowest_s and given.reaction_s > rules.slowest_s:
        return "too slow"
    return "failed play" if rules.failed_plays and session.failed.get(code) else ""


def _violated_rules(plan: Plan, session: SessionState) -> list[dict[str, Any]]:
    rules = plan.design.exclusions
    person = f"sub-{session.trials[0].participant:02d}"
    found: list[dict[str, Any]] = []
    for role, limit in (("attention", rules.attention), ("catch", rules.catch)):
        share = _share_correct(plan, session, role)
        if share is not None and share < limit:
            found.append({"participant": person, "rule": role, "value": share, "limit": limit})
    late = [given.late for given in session.answers.values()]
    if late and sum(late) / len(late) > rules.timeouts:
        found.append(
            {"participant": person, "rule": "timeouts", "value": sum(late) / len(late), "limit": rules.timeouts}
        )
    if rules.training and session.untrained:
        found.append({"participant": person, "rule": "training", "value": float(len(session.untrained)), "limit": 0.0})
    if rules.unfinished and (due := len(session.trials) - session.next_trial):
        found.append({"participant": person, "rule": "unfinished", "value": float(due), "limit": 0.0})
    return found


def _share_correct(plan: Plan, session: SessionState, role: str) -> float | None:
    """Share of correct answers in the trials of a role that have a correct answer; None if there are none yet."""
    right = [
        session.answers[trial.code, name].answer == truth
        for trial in session.trials
        if trial.role == role
        for name in trial.questions
        if (trial.code, name) in session.answers and (truth := right_answer_of_trial(plan, trial, session.chosen, name))
    ]
    return sum(right) / len(right) if right else None
