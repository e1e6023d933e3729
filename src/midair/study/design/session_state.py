"""State of a session, computed from the events of its log, and tables of the answers that the rules do not exclude."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from hashlib import sha256
from typing import Any

from pandas import DataFrame

from midair.errors import BrokenFileError, MidairError, MismatchError
from midair.study.design.plan import Plan, Trial
from midair.study.design.question import right_answer


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenAnswer:
    """One valid answer."""

    answer: str
    """Text as returned by `Question.read`; "n/a" if late."""
    reaction_s: float
    """Time from the question to the answer, in s."""
    time: str
    """ISO 8601."""
    by: str = ""
    """How the time was measured: "key", "line", "page", "model"; empty if the log does not state it."""
    late: bool = False
    """Whether the time limit passed without an answer."""


MARKER = {"kind": (str,), "trial": (str,), "code": (int,), "clock_s": (int, float), "time": (str,)}
"""Fields of a marker in the log and their types: "trial", "stimulus", "answer" or "late"; the code of the trial; the
byte; the time on the clock of LSL in s, that of the computer's monotonic clock without an LSL stream; ISO 8601."""


@dataclass(slots=True, kw_only=True)
class SessionState:
    """Progress of a participant's sessions."""

    trials: tuple[Trial, ...]
    answers: dict[tuple[str, str], GivenAnswer] = field(default_factory=dict[tuple[str, str], GivenAnswer])
    """Valid answers by (trial code, question)."""
    chosen: dict[str, str] = field(default_factory=dict[str, str])
    """Stimuli of adaptive trials by trial code."""
    simulated: bool = False
    """Whether a simulated participant gave any answer."""
    waived: frozenset[str] = frozenset()
    """Codes of training trials that are skipped because the criterion was met."""
    untrained: tuple[str, ...] = ()
    """Blocks that ended without their criterion."""
    form: dict[str, str] = field(default_factory=dict[str, str])
    """Answers to the questions of the form."""
    failed: Counter[str] = field(default_factory=Counter[str])
    """Number of failed and repeated presentations by trial code."""
    began: dict[int, str] = field(default_factory=dict[int, str])
    """Time at which each session was first opened, ISO 8601."""
    markers: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    """Sent event markers, also of discarded trials, with the fields of `MARKER`."""
    broken_off: bool = False
    """Whether the program ended before the session did."""
    stops: list[str] = field(default_factory=list[str])
    """Reasons of all stops."""
    stopped: bool = False
    """Whether the session was stopped and the participant has not agreed to go on."""
    consents: list[str] = field(default_factory=list[str])
    """SHA-256 of each text with which the participant agreed to take part."""

    @property
    def next_trial(self) -> int:
        """Index of the first trial that lacks an answer; the number of trials if none does."""
        for index, trial in enumerate(self.trials):
            if self.open_questions(trial):
                return index
        return len(self.trials)

    @property
    def finished(self) -> bool:
        """Whether every question of every session is answered and the log contains the end."""
        return self.next_trial == len(self.trials) and not self.broken_off

    @property
    def state(self) -> str:
        """Progress as text."""
        many, due = len(self.trials), sum(bool(self.open_questions(trial)) for trial in self.trials)
        if due:
            return f"not finished, {many - due} of {many} trials"
        return f"not finished, {many} of {many} trials without an end" if self.broken_off else "finished"

    def open_questions(self, trial: Trial) -> tuple[str, ...]:
        """Unanswered questions of a trial; empty for a waived trial."""
        if trial.code in self.waived:
            return ()
        return tuple(name for name in trial.questions if (trial.code, name) not in self.answers)


def replay(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int, *, name: str = "log") -> SessionState:
    """Compute the state of a participant's session from its events, the lines of the log in order.

    `name` is that of the log in messages. Raises MismatchError if the log follows another plan or belongs to another
    participant, and BrokenFileError if an event is incomplete or invalid.
    """
    try:
        return _replay_events(events, plan, participant)
    except MismatchError as wrong:
        raise MismatchError(f"{name}: {wrong}") from wrong
    except MidairError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as wrong:
        problem = f"{wrong} is missing" if isinstance(wrong, KeyError) else str(wrong)[:80]
        raise BrokenFileError(
            f"{name}: expected the events of participant {participant}, got a damaged event ({problem}); restore a copy"
        ) from wrong


def _replay_events(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int) -> SessionState:
    state, opened = SessionState(trials=plan.of(participant)), False
    for event in events:
        kind = event["event"]
        if not opened and kind not in ("open", "repair"):
            raise ValueError(f"the log begins with {kind!r}, not with 'open'")
        match kind:
            case "open":
                if event["plan"] != plan.digest:
                    raise MismatchError(
                        f"expected plan {plan.digest}, got {event['plan']}; the plan was changed, or the log"
                        " belongs to another study: restore a copy"
                    )
                if event["participant"] != participant:
                    raise MismatchError(
                        f"expected participant {participant}, got {event['participant']}; the log belongs to another"
                        " person: restore a copy"
                    )
                opened = state.broken_off = True
                state.simulated = state.simulated or bool(event["simulated"])
                if "time" in event:
                    state.began.setdefault(int(event.get("session", 1)), _field(event, "time", str))
            case "done":
                state.broken_off = False
            case "stop" if state.broken_off:  # not after the end, when the program closes
                state.stops.append(_field(event, "reason", str))
                state.stopped = True
            case "consent" if event["to"] == "go on":
                state.stopped = False
            case "consent":
                state.consents.append(_field(event, "sha256", str))
            case "present" if "stimulus" in event:
                state.chosen[_field(event, "trial", str)] = _field(event, "stimulus", str)
            case "silent":
                state.failed[_field(event, "trial", str)] += 1
            case "form":
                state.form[_field(event, "question", str)] = _field(event, "answer", str)
            case "marker":
                state.markers.append({name: _field(event, name, *kinds) for name, kinds in MARKER.items()})
            case "answer" | "late":
                state.answers[_field(event, "trial", str), _field(event, "question", str)] = GivenAnswer(
                    answer="n/a" if kind == "late" else _field(event, "answer", str),
                    reaction_s=_field(event, "reaction_s", int, float),
                    time=_field(event, "time", str),
                    by=str(event.get("by", "")),
                    late=kind == "late",
                )
            case _:
                pass
    answered = {code for code, _ in state.answers}
    if stray := answered - {trial.code for trial in state.trials}:
        raise ValueError(f"trial {min(stray)} does not belong to participant {participant}")
    known = {stimulus.name for stimulus in plan.design.stimuli}
    for trial in state.trials:
        if trial.code in answered and (trial.stimulus or state.chosen.get(trial.code)) not in known:
            raise ValueError(f"trial {trial.code} was answered, but the log does not state its stimulus")
    state.waived, state.untrained = _training_result(plan, state)
    return state


def unfinished_sessions(sessions: Sequence[SessionState]) -> dict[str, str]:
    """State of each unfinished session by participant."""
    return {f"sub-{one.trials[0].participant:02d}": one.state for one in sessions if not one.finished}


def session_notes(plan: Plan, sessions: Sequence[SessionState]) -> tuple[str, ...]:
    """Sentences on the questions, and on people who agreed to take part, were stopped, or have not finished."""
    people = [one for one in sessions if any(given.by != "model" for given in one.answers.values()) or one.stops]
    asked = ", ".join(f"{one.name} ({one.text})" for one in plan.design.questions if one.name not in plan.design.form)
    notes = [f"Questions: {asked}."] if asked else []
    if plan.design.consent and people:
        words = sha256(plan.design.consent.encode()).hexdigest()
        agreed = sum(words in one.consents for one in people)
        notes.append(f"{agreed} of {len(people)} people agreed to the text of the plan (SHA-256 {words[:16]}).")
    stopped = [one for one in people if one.stops]
    if stopped:
        named = ", ".join(
            f"sub-{one.trials[0].participant:02d} ({', '.join(one.stops)}; {'' if one.stopped else 'agreed to go on'})"
            for one in stopped
        ).replace("; )", ")")
        notes.append(f"The sessions of {len(stopped)} of {len(people)} people were stopped: {named}.")
    if unfinished := unfinished_sessions(sessions):
        named = ", ".join(f"{who} ({state.removeprefix('not finished, ')})" for who, state in unfinished.items())
        notes.append(f"Sessions that are not finished: {named}.")
    return tuple(notes)


def _training_result(plan: Plan, state: SessionState) -> tuple[frozenset[str], tuple[str, ...]]:
    """Trials waived because a training criterion was met, and blocks that ended without theirs."""
    waived: list[str] = []
    untrained: list[str] = []
    for block in plan.design.blocks:
        if block.criterion is None:
            continue
        last: list[bool] = []
        met = False
        for trial in (trial for trial in state.trials if trial.block == block.name):
            if met:
                waived.append(trial.code)
            elif trial.role == "test" and (given := state.answers.get((trial.code, block.questions[0]))):
                last.append(given.answer == right_answer_of_trial(plan, trial, state.chosen, block.questions[0]))
                recent = last[-block.criterion.last :]
                met = len(recent) == block.criterion.last and sum(recent) >= block.criterion.right * len(recent)
        if last and not met:
            untrained.append(block.name)
    return frozenset(waived), tuple(untrained)


def right_answer_of_trial(plan: Plan, trial: Trial, chosen: Mapping[str, str], name: str) -> str:
    """Correct answer to a question of a trial; empty if there is none or nothing was presented yet."""
    presented = trial.stimulus or chosen.get(trial.code, "")
    if not presented:
        return ""
    stimulus, question = plan.design.stimulus(presented), plan.design.question(name)
    # Levels of the question override those of the trial, which override those of the stimulus.
    return right_answer(question, stimulus, {**stimulus.levels, **trial.levels, **question.levels})


def _field(event: Mapping[str, Any], name: str, *kinds: type) -> Any:
    """Value of a field of an event; TypeError if its type is not one of `kinds`."""
    value = event[name]
    if type(value) not in kinds:
        raise TypeError(f"{name} is {str(value)[:40]!r}")
    return value


def excluded_participants(plan: Plan, sessions: Sequence[SessionState]) -> DataFrame:
    """Participants whom a rule of the plan excludes.

    Columns participant, rule, value (measured), limit (allowed by the plan); no rows if all participants are analysed.
    """
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
        "failed_plays": session.failed[trial.code],
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
    rows: list[dict[str, Any]] = []
    for session in sessions:
        trials = {trial.code: trial for trial in session.trials}
        for marker in session.markers:
            trial = trials[marker["trial"]]
            time: str = marker["time"]
            place = {"participant": f"sub-{trial.participant:02d}", "session": trial.session}
            event = {"onset": seconds_between(session.began.get(trial.session, time), time), "duration": "n/a"}
            event |= {"trial_type": marker["kind"], "value": marker["code"]}
            rows.append(place | event | {"trial": trial.number, "clock": marker["clock_s"]})
    return DataFrame(rows)
