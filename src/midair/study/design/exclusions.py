"""Who and what is left out, by the rules that the plan has stated beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from midair.study.design.session_state import SessionState, right_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

    from midair.study.design.plan import Plan
    from midair.study.design.session_state import GivenAnswer


def left_out(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Every participant whom a rule of the plan leaves out.

    Returns
    -------
    DataFrame
        Columns participant, rule, value (what was found), limit (what the plan allows); empty if nobody is.
    """
    from pandas import DataFrame

    rows = [row for session in sessions for row in _broken_rules(plan, session)]
    return DataFrame(rows, columns=["participant", "rule", "value", "limit"])


def why_left_out(plan: Plan, session: SessionState) -> str:
    """The first rule that leaves the participant of a session out; empty if none does."""
    return next((f"participant: {row['rule']}" for row in _broken_rules(plan, session)), "")


def why_answer_left_out(plan: Plan, session: SessionState, code: str, given: GivenAnswer) -> str:
    """The rule that leaves one answer out; empty if none does."""
    rules = plan.design.exclusions
    if given.late:
        return "timeout"
    if given.reaction_s < rules.fastest_s:
        return "too fast"
    if rules.slowest_s and given.reaction_s > rules.slowest_s:
        return "too slow"
    return "failed play" if rules.failed_plays and session.failed.get(code) else ""


def _broken_rules(plan: Plan, session: SessionState) -> list[dict[str, Any]]:
    rules = plan.design.exclusions
    person = f"sub-{session.trials[0].participant:02d}"
    found: list[dict[str, Any]] = []
    for role, limit in (("attention", rules.attention), ("catch", rules.catch)):
        share = _share_right(plan, session, role)
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


def _share_right(plan: Plan, session: SessionState, role: str) -> float | None:
    """Share of right answers in the trials of a role that have a right answer; None if there are none yet."""
    right = [
        session.answers[trial.code, name].answer == truth
        for trial in session.trials
        if trial.role == role
        for name in trial.questions
        if (trial.code, name) in session.answers and (truth := right_of(plan, trial, session.chosen, name))
    ]
    return sum(right) / len(right) if right else None
