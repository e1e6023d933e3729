"""What a log of events says: which answers count, and where a session goes on. Pure: the log is a list of dicts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from midair.errors import BrokenFileError, MidairError, MismatchError
from midair.study.design.plan import Plan, Trial
from midair.study.design.stimulus import right_answer

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

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
    by : str
        How the time was taken: "key", "line", "page", "model"; empty where the log does not say.
    late : bool
        Whether none came in time; the answer is then "n/a".
    """

    answer: str
    reaction_s: float
    time: str
    by: str = ""
    late: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionState:
    """Where a session stands.

    Attributes
    ----------
    trials : tuple of Trial
        Trials of this participant.
    answers : mapping of (code, question) to GivenAnswer
        Those that count.
    chosen : mapping of code to str
        Stimuli of adaptive trials.
    interruptions, withdrawn : int
        How often the session was taken up again, and answers that a policy has put aside (they stay in the log).
    simulated : bool
        Whether a simulated participant gave any of them.
    waived : frozenset of str
        Codes of trials that do not come any more: the criterion of their training was met.
    untrained : tuple of str
        Blocks that ended without their criterion.
    form : mapping of str to str
        Answers to the questions of the form.
    failed : mapping of code to int
        How often the presentation of a trial failed and was made again.
    began : mapping of int to str
        When each session was first opened, ISO 8601.
    broken_off : bool
        Whether the program ended before the session did.
    """

    trials: tuple[Trial, ...]
    answers: Mapping[tuple[str, str], GivenAnswer]
    chosen: Mapping[str, str]
    interruptions: int = 0
    withdrawn: int = 0
    simulated: bool = False
    waived: frozenset[str] = frozenset()
    untrained: tuple[str, ...] = ()
    form: Mapping[str, str] = field(default_factory=dict[str, str])
    failed: Mapping[str, int] = field(default_factory=dict[str, int])
    began: Mapping[int, str] = field(default_factory=dict[int, str])
    broken_off: bool = False

    @property
    def next_trial(self) -> int:
        """Index of the first trial that lacks an answer; their number if none does."""
        for index, trial in enumerate(self.trials):
            if self.open_questions(trial):
                return index
        return len(self.trials)

    @property
    def finished(self) -> bool:
        """Whether every question of every session is answered, and the log says that it ended."""
        return self.next_trial == len(self.trials) and not self.broken_off

    @property
    def state(self) -> str:
        """How far the session is, in words."""
        many, due = len(self.trials), sum(bool(self.open_questions(trial)) for trial in self.trials)
        if due:
            return f"not finished, {many - due} of {many} trials"
        return f"not finished, {many} of {many} trials without an end" if self.broken_off else "finished"

    def open_questions(self, trial: Trial) -> tuple[str, ...]:
        """Questions of a trial without an answer; none of a trial that is waived."""
        if trial.code in self.waived:
            return ()
        return tuple(name for name in trial.questions if (trial.code, name) not in self.answers)

    def redo(self, policy: Policy) -> tuple[str, ...]:
        """Codes of the trials whose answers a policy puts aside."""
        index = self.next_trial
        # Up to the trial that was interrupted, some of whose questions may have been answered.
        if policy == "restart":
            current = self.trials[min(index, len(self.trials) - 1)].session
            return tuple(trial.code for trial in self.trials[: index + 1] if trial.session == current)
        if policy == "block" and index < len(self.trials):
            block = self.trials[index].block
            return tuple(trial.code for trial in self.trials[: index + 1] if trial.block == block)
        return ()


def replay(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int, *, name: str = "log") -> SessionState:
    """Where a session stands after its events.

    Parameters
    ----------
    events : iterable of mapping
        Lines of the log, in order.
    plan : Plan
        The plan that the session follows.
    participant : int
        Number of the participant whose log it is.
    name : str
        Of the log, for messages.

    Raises
    ------
    MismatchError
        If the log follows another plan, or belongs to another participant.
    BrokenFileError
        If an event lacks something, or says what none can.
    """
    try:
        return _replayed(events, plan, participant)
    except MismatchError as wrong:
        raise MismatchError(f"{name}: {wrong}") from wrong
    except MidairError:
        raise
    except (AttributeError, LookupError, TypeError, ValueError) as wrong:
        said = f"nothing of {wrong}" if isinstance(wrong, KeyError) else str(wrong)[:80]
        raise BrokenFileError(
            f"{name}: expected the events of participant {participant}, got a damaged one ({said}); restore a copy"
        ) from wrong


def _replayed(events: Iterable[Mapping[str, Any]], plan: Plan, participant: int) -> SessionState:
    told = _EventsTold()
    for event in events:
        told.take(event, plan, participant)
    trials = plan.of(participant)
    if stray := {code for code, _ in told.answers} - {trial.code for trial in trials}:
        raise ValueError(f"trial {min(stray)} is none of participant {participant}")
    _check_presented(trials, {code for code, _ in told.answers}, told.chosen, plan)
    waived, untrained = _trained(plan, trials, told)
    return SessionState(
        trials=trials,
        answers=told.answers,
        chosen=told.chosen,
        interruptions=told.interruptions,
        withdrawn=told.withdrawn,
        simulated=told.simulated,
        waived=waived,
        untrained=untrained,
        form=told.form,
        failed=told.failed,
        began=told.began,
        broken_off=told.broken_off,
    )


@dataclass(slots=True, kw_only=True)
class _EventsTold:
    """What the events have told so far."""

    answers: dict[tuple[str, str], GivenAnswer] = field(default_factory=dict[tuple[str, str], GivenAnswer])
    chosen: dict[str, str] = field(default_factory=dict[str, str])
    form: dict[str, str] = field(default_factory=dict[str, str])
    failed: dict[str, int] = field(default_factory=dict[str, int])
    began: dict[int, str] = field(default_factory=dict[int, str])
    interruptions: int = 0
    withdrawn: int = 0
    simulated: bool = False
    broken_off: bool = False
    opened: bool = False

    def take(self, event: Mapping[str, Any], plan: Plan, participant: int) -> None:
        """Take down one event."""
        kind = event["event"]
        if not self.opened and kind not in ("open", "repair"):
            raise ValueError(f"it begins with {kind!r} and not with 'open'")
        match kind:
            case "open":
                self._open(event, plan, participant)
            case "done":
                self.broken_off = False
            case "resume":
                self._resume(set(event["redo"]))
            case "present" if "stimulus" in event:
                self.chosen[_told(event, "trial", str)] = _told(event, "stimulus", str)
            case "silent":
                code = _told(event, "trial", str)
                self.failed[code] = self.failed.get(code, 0) + 1
            case "form":
                self.form[_told(event, "question", str)] = _told(event, "answer", str)
            case "answer" | "late":
                self._answer(event)
            case _:
                pass

    def _open(self, event: Mapping[str, Any], plan: Plan, participant: int) -> None:
        if event["plan"] != plan.digest:
            raise MismatchError(
                f"expected plan {plan.digest}, got {event['plan']}; the plan has been changed since, or the log"
                " is of another study: restore a copy"
            )
        if event["participant"] != participant:
            raise MismatchError(
                f"expected participant {participant}, got {event['participant']}; the log is of another person:"
                " restore a copy"
            )
        self.opened = True
        self.simulated = self.simulated or bool(event["simulated"])
        if "time" in event:
            self.began.setdefault(int(event.get("session", 1)), _told(event, "time", str))
        self.broken_off = True

    def _resume(self, again: set[str]) -> None:
        kept = {key: answer for key, answer in self.answers.items() if key[0] not in again}
        self.interruptions, self.withdrawn = self.interruptions + 1, self.withdrawn + len(self.answers) - len(kept)
        self.answers = kept
        self.chosen = {code: name for code, name in self.chosen.items() if code not in again}

    def _answer(self, event: Mapping[str, Any]) -> None:
        late = event["event"] == "late"
        self.answers[_told(event, "trial", str), _told(event, "question", str)] = GivenAnswer(
            answer="n/a" if late else _told(event, "answer", str),
            reaction_s=_told(event, "reaction_s", int, float),
            time=_told(event, "time", str),
            by=str(event.get("by", "")),
            late=late,
        )


def _trained(plan: Plan, trials: Sequence[Trial], told: _EventsTold) -> tuple[frozenset[str], tuple[str, ...]]:
    """Trials that do not come since a criterion was met, and blocks that ended without theirs."""
    waived: list[str] = []
    untrained: list[str] = []
    for block in plan.design.blocks:
        if block.criterion is None:
            continue
        last: list[bool] = []
        met = False
        for trial in (trial for trial in trials if trial.block == block.name):
            if met:
                waived.append(trial.code)
            elif trial.role == "test" and (given := told.answers.get((trial.code, block.questions[0]))):
                last.append(given.answer == right_of(plan, trial, told.chosen, block.questions[0]))
                recent = last[-block.criterion.last :]
                met = len(recent) == block.criterion.last and sum(recent) >= block.criterion.right * len(recent)
        if last and not met:
            untrained.append(block.name)
    return frozenset(waived), tuple(untrained)


def right_of(plan: Plan, trial: Trial, chosen: Mapping[str, str], name: str) -> str:
    """The right answer to a question of a trial; empty where there is none, or nothing was presented yet."""
    presented = trial.stimulus or chosen.get(trial.code, "")
    if not presented:
        return ""
    stimulus, question = plan.design.stimulus(presented), plan.design.question(name)
    # What is said nearer to the question goes before.
    return right_answer(question, stimulus, {**stimulus.levels, **trial.levels, **question.levels})


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
