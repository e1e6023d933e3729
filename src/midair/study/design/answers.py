"""Tables of the answers and markers of a study, and the participants and answers that the plan's rules exclude."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any

from midair.errors import BrokenFileError
from midair.study.design.session_state import right_answer_of_trial

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

    from midair.study.design.plan import Plan, Trial
    from midair.study.design.session_state import GivenAnswer, SessionState


def excluded_participants(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Participants whom a rule of the plan excludes.

    Columns participant, rule, value (measured), limit (allowed by the plan); no rows if all participants are analysed.
    """
    from pandas import DataFrame

    rows = [
        (f"sub-{session.trials[0].participant:02d}", *row)
        for session in sessions
        for row in _violated_rules(plan, session)
    ]
    return DataFrame(rows, columns=["participant", "rule", "value", "limit"])


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


def _violated_rules(plan: Plan, session: SessionState) -> list[tuple[str, float, float]]:
    """Each rule that excludes the participant of a session, the measured value and the limit."""
    rules = plan.design.exclusions
    found: list[tuple[str, float, float]] = []
    for role, limit in (("attention", rules.attention), ("catch", rules.catch)):
        right = [
            session.answers[trial.code, name].answer == truth
            for trial in session.trials
            if trial.role == role
            for name in trial.questions
            if (trial.code, name) in session.answers
            and (truth := right_answer_of_trial(plan, trial, session.chosen, name))
        ]
        share = sum(right) / len(right) if right else None
        if share is not None and share < limit:
            found.append((role, share, limit))
    late = [given.late for given in session.answers.values()]
    if late and sum(late) / len(late) > rules.timeouts:
        found.append(("timeouts", sum(late) / len(late), rules.timeouts))
    if rules.training and session.untrained:
        found.append(("training", float(len(session.untrained)), 0.0))
    if rules.unfinished and (due := len(session.trials) - session.next_trial):
        found.append(("unfinished", float(due), 0.0))
    return found


def answers_table(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Table of all valid answers, without those to private questions (they stay in the log).

    One row per answer, in the order of asking, with columns participant, session, trial, block, group, repetition,
    stimulus, role, scored, excluded (rule of the plan that excludes the answer or its participant; excluded answers are
    not scored), question, kind, answer, right (correct answer), correct (1, 0, or -1 for questions without a correct
    answer), reaction_s, reaction_by, failed_plays, time (s from the beginning of the session), simulated, one column
    per question of the form, and one per factor, "n/a" where a factor has no level.
    """
    from pandas import DataFrame

    rows: list[dict[str, Any]] = []
    for session in sessions:
        out = next((f"participant: {rule}" for rule, _, _ in _violated_rules(plan, session)), "")
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


def markers_table(sessions: Sequence[SessionState]) -> DataFrame:
    """Table of all sent markers with the columns of a BIDS table of events, and participant, session and trial."""
    from pandas import DataFrame

    rows: list[dict[str, Any]] = []
    for session in sessions:
        trials = {trial.code: trial for trial in session.trials}
        for marker in session.markers:
            trial = trials[marker.trial]
            rows.append(
                {
                    "participant": f"sub-{trial.participant:02d}",
                    "session": trial.session,
                    "onset": seconds_between(session.began.get(trial.session, marker.time), marker.time),
                    "duration": "n/a",
                    "trial_type": marker.kind,
                    "value": marker.code,
                    "trial": trial.number,
                    "clock": marker.clock_s,
                }
            )
    return DataFrame(rows)
