"""One participant's session: present, ask, time, store. Free of any screen: a terminal, a page or a test drives it.

A `Session` is a state: `step` says what is due, and `acknowledge`, `present`, `answer` and `stop` move it on. `run` is
the loop for whoever drives with calls of their own (`Screen`). What a step shows never tells the condition.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from threading import RLock
from time import monotonic
from types import TracebackType
from typing import Any, Literal, Protocol, Self

from midair.errors import DeviceError, DeviceStateError, InputError, SilentFramesError
from midair.model import Medium
from midair.study.design import Plan, Policy, Question, Standing, Stimulus, Trial, next_stimulus, replay
from midair.study.session.event_log import EventLog, read_events
from midair.study.session.presenters import Presenter

ATTEMPTS = 3
"""How often a stimulus is presented that an array did not play to its end, before the session ends."""

AGAIN = "The last presentation was interrupted by a fault of the device. It comes once more, from its beginning."


class Clock(Protocol):
    """Time, as an argument."""

    def now(self) -> str:
        """Date and time, ISO 8601."""
        ...

    def elapsed(self) -> float:
        """A time that never goes back, in s."""
        ...


class SystemClock:
    """The clock of this computer."""

    def now(self) -> str:
        """Date and time in UTC, ISO 8601."""
        return datetime.now(UTC).isoformat(timespec="milliseconds")

    def elapsed(self) -> float:
        """Monotonic time, in s."""
        return monotonic()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialStep:
    """What is due, without a word on the condition.

    Attributes
    ----------
    kind : {"show", "present", "ask", "rest", "done", "stopped"}
        A text to read; a stimulus to present; a question; a break; the end; the end by a stop.
    text : str
        To show.
    code : str
        Of the trial, if it belongs to one.
    number, total : int
        Of the trial within the session.
    question : Question or None
        To ask.
    rest_s : float
        Shortest break, in s.
    """

    kind: Literal["show", "present", "ask", "rest", "done", "stopped"]
    text: str = ""
    code: str = ""
    number: int = 0
    total: int = 0
    question: Question | None = None
    rest_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What somebody said; `reaction_s` only where the screen has measured it better than the session can."""

    text: str
    reaction_s: float | None = None


class Screen(Protocol):
    """What participant and experimenter see."""

    def show(self, text: str) -> None:
        """Show a text; return when it has been read."""
        ...

    def rest(self, step: TrialStep) -> None:
        """Return when the break is over."""
        ...

    def ask(self, step: TrialStep) -> Reply:
        """Ask the question of the step."""
        ...

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Tell that the answer is stored."""
        ...

    def refused(self, step: TrialStep, why: str) -> None:
        """Tell that it was no answer; the question comes again."""
        ...


class Session:
    """A session of one participant; a context manager that silences the presenter however it is left.

    Parameters
    ----------
    plan : Plan
        Drawn before.
    participant : int
        Number, from 1 on.
    log : Path
        Of this participant; a log with answers in it is taken up again.
    presenter : Presenter
        What makes the stimuli felt.
    policy : {"resume", "restart", "block"}
        How a session that was interrupted goes on, always at the beginning of a trial: "resume" presents the unfinished
        trial again and asks only what has no answer yet; the others put answers aside, which stay in the log.
    simulated : bool
        Whether no person takes part; written into the log and from there into every result.
    room : Medium, optional
        The air in which it takes place, for the log; None where nobody stated it.
    clock : Clock, optional
        The computer's if None.
    """

    def __init__(
        self,
        plan: Plan,
        participant: int,
        log: Path,
        presenter: Presenter,
        *,
        policy: Policy = "resume",
        simulated: bool = False,
        room: Medium | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.plan = plan
        self.participant = participant
        self._log = EventLog(log)
        self._presenter = presenter
        self._policy: Policy = policy
        self._simulated = simulated
        self._room = None if room is None else {"temperature_c": room.temperature, "humidity": room.humidity}
        self._clock = clock or SystemClock()
        self._stopped = False
        self._entered = False
        self._ending = RLock()  # a stop from another thread is in the log before the log closes
        self._step = TrialStep(kind="show")
        self._silences = 0
        self._since = 0.0
        self._script: Iterator[TrialStep] = iter(())
        self._trials: dict[str, Trial] = {}

    def __enter__(self) -> Self:
        self._log.__enter__()
        try:
            events = read_events(self._log.path)
            before = replay(events, self.plan, self.participant)
            about = {"participant": self.participant, "simulated": self._simulated, "room": self._room}
            self._write("open", plan=self.plan.digest, **about)
            if any(event["event"] == "open" for event in events) and before.next_trial < len(before.trials):
                self._write("resume", policy=self._policy, redo=list(before.redo(self._policy)))
            progress = replay(read_events(self._log.path), self.plan, self.participant)
        except BaseException:
            self._log.close()
            raise
        self._trials = {trial.code: trial for trial in progress.trials}
        self._script = self._steps(progress)
        self._entered = True
        self._advance()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._ending:
            try:
                if self.step.kind not in ("done", "stopped"):
                    self.stop("left" if kind is None else kind.__name__)
                self._presenter.silence()
            finally:
                self._entered = False
                self._log.close()

    @property
    def step(self) -> TrialStep:
        """What is due."""
        return TrialStep(kind="stopped") if self._stopped else self._step

    def acknowledge(self) -> None:
        """The text was read, or the break is over."""
        self._expect("show", "rest")
        self._advance()

    def present(self) -> None:
        """Present the stimulus that is due; returns when it is over.

        One that an array did not play to its end is marked in the log and due again, after a word to the participant.

        Raises
        ------
        SilentFramesError
            If the array went silent in it `ATTEMPTS` times, one after the other.
        """
        step = self._expect("present")
        stimulus = self._due(self._trials[step.code])
        try:
            for name in stimulus.members or (stimulus.name,):
                if not self._stopped:
                    self._presenter.present(self.plan.design.stimulus(name))
        except DeviceError as wrong:
            self._failed(step, wrong)
            return
        if not self._stopped:
            self._silences = 0
            self._write("presented", trial=step.code)
            self._advance()

    def answer(self, reply: Reply) -> str:
        """Store an answer to the question that is due; when this returns it is on disk.

        Returns
        -------
        str
            As it was stored.

        Raises
        ------
        InputError
            If it is no answer to the question; the question stays due.
        """
        step = self._expect("ask")
        if step.question is None:
            raise DeviceStateError("session: expected a question to be due, got none")
        said = step.question.read(reply.text)
        reaction = self._clock.elapsed() - self._since if reply.reaction_s is None else reply.reaction_s
        self._write("answer", trial=step.code, question=step.question.name, answer=said, reaction_s=round(reaction, 4))
        self._advance()
        return said

    def stop(self, reason: str) -> None:
        """Emergency stop: silence first, then a line in the log. From any thread, at any time."""
        with self._ending:
            self._stopped = True
            self._presenter.silence()
            if self._entered:
                self._write("stop", reason=reason)

    def _failed(self, step: TrialStep, wrong: DeviceError) -> None:
        """Take down that a trial was not felt as it should, and make it due again if the array can still play."""
        if self._stopped:
            raise wrong
        self._write("silent", trial=step.code, reason=str(wrong))
        self._silences += 1
        if not isinstance(wrong, SilentFramesError):
            raise wrong
        if self._silences == ATTEMPTS:
            raise SilentFramesError(
                f"trial {step.number}: silent {ATTEMPTS} times, the session ends; {wrong}"
            ) from wrong
        self._script = chain([step], self._script)
        self._step = TrialStep(kind="show", text=AGAIN)

    def _due(self, trial: Trial) -> Stimulus:
        """The stimulus of a trial; the choice of an adaptive block is in the log before it is felt."""
        if trial.stimulus:
            self._write("present", trial=trial.code)
            return self.plan.design.stimulus(trial.stimulus)
        progress = replay(read_events(self._log.path), self.plan, self.participant)
        name = next_stimulus(self.plan, progress, trial)
        self._write("present", trial=trial.code, stimulus=name)
        return self.plan.design.stimulus(name)

    def _expect(self, *kinds: str) -> TrialStep:
        if not self._entered:
            raise DeviceStateError("session: expected to be entered; use it as a context manager")
        if self.step.kind not in kinds:
            raise DeviceStateError(f"session: expected {' or '.join(kinds)} to be due, got {self.step.kind}")
        return self.step

    def _advance(self) -> None:
        self._step = next(self._script, TrialStep(kind="done"))
        self._since = self._clock.elapsed()
        if self._step.kind == "done":
            self._write("done")

    def _write(self, event: str, **fields: Any) -> None:
        self._log.append({"event": event, **fields, "time": self._clock.now()})

    def _steps(self, progress: Standing) -> Iterator[TrialStep]:
        design, trials = self.plan.design, progress.trials
        first = progress.next_trial
        if design.consent and first < len(trials):
            yield TrialStep(kind="show", text=design.consent)
        for index in range(first, len(trials)):
            trial = trials[index]
            block = design.block(trial.block)
            place: dict[str, Any] = {"code": trial.code, "number": trial.number, "total": len(trials)}
            if block.text and (index == first or trials[index - 1].block != trial.block):
                yield TrialStep(kind="show", text=block.text)
            yield TrialStep(kind="present", **place)
            for name in progress.open_questions(trial):
                yield TrialStep(kind="ask", question=design.question(name), **place)
            last = index + 1 == len(trials)
            if block.rest_s and not last and trials[index + 1].block != trial.block:
                yield TrialStep(kind="rest", rest_s=block.rest_s, **place)
        if design.debrief and first < len(trials):
            yield TrialStep(kind="show", text=design.debrief)


def run(session: Session, screen: Screen) -> TrialStep:
    """Drive a session that was entered to its end, or to a stop.

    Returns
    -------
    Step
        Of kind "done" or "stopped".
    """
    while (step := session.step).kind not in ("done", "stopped"):
        if step.kind == "present":
            session.present()
        elif step.kind == "ask":
            try:
                answer = session.answer(screen.ask(step))
            except InputError as wrong:
                screen.refused(step, str(wrong))
            else:
                screen.accepted(step, answer)
        else:
            _ = screen.show(step.text) if step.kind == "show" else screen.rest(step)
            if session.step == step:
                session.acknowledge()
    return session.step
