"""What a log of events says: which answers count, and where a session goes on. Pure: the log is a list of dicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from midair.errors import BrokenFileError, MidairError, MismatchError
from midair.study.design.blocks import right_answer
from midair.study.design.plan import Plan, Trial

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pandas import DataFrame

Policy = Literal["resume", "restart", "block"]
"""After an interruption: go on with the trial that was not finished; begin again; begin the block again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenAnswer:
    """One answer that counts.

    Attributes
    ----------
    answer : str
        As `Question.read` gave it.
    reaction_s : float
        Time from the question to the answer, in s.
    time : str
        When, ISO 8601.
    """

    answer: str
    reaction_s: float
    time: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Where a session stands.

    Attributes
    ----------
    trials : tuple of Trial
        Trials of this participant.
    answers : mapping of (code, question) to Answer
        Those that count.
    chosen : mapping of code to str
        Stimuli of adaptive trials.
    interruptions, withdrawn : int
        How often the session was taken up again, and answers that a policy has put aside (they stay in the log).
    simulated : bool
        Whether a simulated participant gave any of them.
    """

    trials: tuple[Trial, ...]
    answers: Mapping[tuple[str, str], GivenAnswer]
    chosen: Mapping[str, str]
    interruptions: int = 0
    withdrawn: int = 0
    simulated: bool = False

    @property
    def next_trial(self) -> int:
        """Index of the first trial that lacks an answer; their number if none does."""
        for index, trial in enumerate(self.trials):
            if self.open_questions(trial):
                return index
        return len(self.trials)

    def open_questions(self, trial: Trial) -> tuple[str, ...]:
        """Questions of a trial without an answer."""
        return tuple(name for name in trial.questions if (trial.code, name) not in self.answers)

    def redo(self, policy: Policy) -> tuple[str, ...]:
        """Codes of the trials whose answers a policy puts aside."""
        index = self.next_trial
        # Up to the trial that was interrupted, some of whose questions may have been answered.
        if policy == "restart":
            return tuple(trial.code for trial in self.trials[: index + 1])
        if policy == "block" and index < len(self.trials):
            block = self.trials[index].block
            return tuple(trial.code for trial in self.trials[: index + 1] if trial.block == block)
        return ()


def replay(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int) -> Standing:
    """Where a session stands after its events.

    Parameters
    ----------
    events : iterable of mapping
        Lines of the log, in order.
    plan : Plan
        The plan that the session follows.
    participant : int
        Number of the participant whose log it is.

    Raises
    ------
    MismatchError
        If the log follows another plan, or belongs to another participant.
    BrokenFileError
        If an event lacks something, or says what none can.
    """
    try:
        return _replayed(events, plan, participant)
    except MidairError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as wrong:
        said = f"nothing of {wrong}" if isinstance(wrong, KeyError) else str(wrong)[:80]
        raise BrokenFileError(
            f"log: expected the events of participant {participant}, got a damaged one ({said}); restore a copy"
        ) from wrong


def _replayed(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int) -> Standing:
    answers: dict[tuple[str, str], GivenAnswer] = {}
    chosen: dict[str, str] = {}
    interruptions = withdrawn = 0
    simulated = False
    for event in events:
        if event["event"] == "open":
            if (event["plan"], event["participant"]) != (plan.digest, participant):
                raise MismatchError(
                    f"log: expected plan {plan.digest}, participant {participant}, got {event['plan']}, participant"
                    f" {event['participant']}; the plan has been changed since"
                )
            simulated = simulated or bool(event["simulated"])
        elif event["event"] == "resume":
            again = set(event["redo"])
            kept = {key: answer for key, answer in answers.items() if key[0] not in again}
            interruptions, withdrawn = interruptions + 1, withdrawn + len(answers) - len(kept)
            answers = kept
            chosen = {code: name for code, name in chosen.items() if code not in again}
        elif event["event"] == "present" and "stimulus" in event:
            chosen[_told(event, "trial", str)] = _told(event, "stimulus", str)
        elif event["event"] == "answer":
            key = (_told(event, "trial", str), _told(event, "question", str))
            answers[key] = GivenAnswer(
                answer=_told(event, "answer", str),
                reaction_s=_told(event, "reaction_s", int, float),
                time=_told(event, "time", str),
            )
    trials = plan.of(participant)
    _check_presented(trials, {code for code, _ in answers}, chosen, plan)
    return Standing(
        trials=trials,
        answers=answers,
        chosen=chosen,
        interruptions=interruptions,
        withdrawn=withdrawn,
        simulated=simulated,
    )


def _check_presented(trials: Sequence[Trial], answered: set[str], chosen: Mapping[str, str], plan: Plan) -> None:
    """Raise if nothing says what was presented before an answer."""
    known = {stimulus.name for stimulus in plan.design.stimuli}
    for trial in trials:
        if trial.code in answered and (trial.stimulus or chosen.get(trial.code)) not in known:
            raise ValueError(f"trial {trial.code} was answered, and nothing says what was presented")


def _told(event: Mapping[str, Any], name: str, *kinds: type) -> Any:
    """What an event says; TypeError if it is of another kind."""
    value = event[name]
    if type(value) not in kinds:
        raise TypeError(f"{name} is {str(value)[:40]!r}")
    return value


def answers_table(plan: Plan, sessions: Sequence[Standing]) -> DataFrame:
    """Every answer that counts as a row; the key that opens the blinding.

    Returns
    -------
    DataFrame
        Columns participant, trial, block, group, repetition, stimulus, scored, question, kind, answer, right, correct
        (1, 0, or -1 where nothing is right or wrong), reaction_s, time, simulated, and one a factor, "n/a" where a
        factor has no level. In the order of asking.
    """
    from pandas import DataFrame

    rows = [
        _answer_row(plan, session, trial, name)
        for session in sessions
        for trial in session.trials
        for name in trial.questions
        if (trial.code, name) in session.answers
    ]
    return DataFrame(rows)


def _answer_row(plan: Plan, session: Standing, trial: Trial, name: str) -> dict[str, Any]:
    question = plan.design.question(name)
    given = session.answers[trial.code, name]
    stimulus = plan.design.stimulus(trial.stimulus or session.chosen[trial.code])
    # What is said nearer to the question goes before.
    levels = {**stimulus.levels, **trial.levels, **question.levels}
    right = right_answer(question, stimulus, levels)
    row: dict[str, Any] = {
        "participant": f"sub-{trial.participant:02d}",
        "trial": trial.number,
        "block": trial.block,
        "group": trial.group,
        "repetition": trial.repetition,
        "stimulus": stimulus.name,
        "scored": trial.scored,
        "question": name,
        "kind": question.kind,
        "answer": given.answer,
        "right": right or "n/a",
        "correct": int(given.answer == right) if right else -1,
        "reaction_s": given.reaction_s,
        "time": given.time,
        "simulated": session.simulated,
    }
    return row | {factor: levels.get(factor, "n/a") for factor in plan.design.factors}
