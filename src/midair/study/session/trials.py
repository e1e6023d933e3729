"""One participant's session: present, ask, time, store. Free of any screen: a terminal, a page or a test drives it.

A `Session` is a state: `step` says what is due, and `acknowledge`, `present`, `answer` and `stop` move it on. `run` is
the loop for whoever drives with calls of their own (`Screen`). What a step shows never tells the condition.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from threading import Event, RLock
from types import TracebackType
from typing import Any, Self

from midair.errors import DeviceError, DeviceStateError, InputError, SilentFramesError
from midair.model import Medium
from midair.study.design import Plan, Policy, SessionState, Stimulus, Trial, next_stimulus, replay
from midair.study.session.event_log import EventLog, read_events
from midair.study.session.presenters import Presenter, SilentPresenter
from midair.study.session.steps import Clock, Reply, Screen, SystemClock, TrialStep, steps_of

ATTEMPTS = 3
"""How often a stimulus is presented that an array did not play to its end, before the session ends."""

AGAIN = "The last presentation was interrupted by a fault of the device. It comes once more, from its beginning."


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
    about : mapping, optional
        What else the log says of the session when it is opened, such as the noise in the headphones.

    Raises
    ------
    MismatchError
        On entering, if the log follows another plan.
    BrokenFileError
        On entering, if the log was changed since it was written.
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
        about: Mapping[str, Any] | None = None,
    ) -> None:
        self.plan = plan
        self.participant = participant
        # Where nothing is presented nobody answers: a model would say the same again.
        self._log = EventLog(log, synced=not isinstance(presenter, SilentPresenter), chained=plan.chain)
        self._presenter = presenter
        self._policy: Policy = policy
        self._simulated = simulated
        self._room = None if room is None else {"temperature_c": room.temperature, "humidity": room.humidity}
        self._clock = clock or SystemClock()
        self._about = dict(about or {})
        self._stopped = Event()
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
            before = self.standing()
            due = before.trials[min(before.next_trial, len(before.trials) - 1)]
            about = {"participant": self.participant, "simulated": self._simulated, "room": self._room}
            self._write("open", plan=self.plan.digest, session=due.session, **about, **self._about)
            if before.broken_off and before.next_trial < len(before.trials):
                self._write("resume", policy=self._policy, redo=list(before.redo(self._policy)))
        except BaseException:
            self._log.close()
            raise
        self._trials = {trial.code: trial for trial in before.trials}
        self._script = steps_of(self.plan, self.standing)
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
        return TrialStep(kind="stopped") if self._stopped.is_set() else self._step

    @property
    def log(self) -> Path:
        """The file of the log."""
        return self._log.path

    @property
    def seal(self) -> str:
        """The last link of the chain over the whole log: whoever noted it can tell a log that was written anew."""
        return self._log.seal

    def standing(self) -> SessionState:
        """Where the session stands, by its log."""
        return replay(read_events(self._log.path, chained=self.plan.chain), self.plan, self.participant)

    def acknowledge(self) -> None:
        """The text was read, or the break is over."""
        self._expect("show", "rest")
        self._advance()

    def present(self, cue: Callable[[str], None] | None = None) -> None:
        """Present the stimulus that is due, after the time that was drawn for it; returns when it is over.

        One that an array did not play to its end is marked in the log and due again, after a word to the participant.

        Parameters
        ----------
        cue : callable, optional
            Called with what the participant is to be told as a stimulus begins, and with "" when all is over.

        Raises
        ------
        SilentFramesError
            If the array went silent in it `ATTEMPTS` times, one after the other.
        """
        step = self._expect("present")
        trial = self._trials[step.code]
        stimulus = self._due(trial)
        try:
            self._clock.wait(trial.wait_s, self._stopped)
            self._make_felt(stimulus, step.text, cue or _to_nobody)
        except DeviceError as wrong:
            self._failed(step, wrong)
            return
        if not self._stopped.is_set():
            self._silences = 0
            self._write("presented", trial=step.code)
            self._advance()

    def answer(self, reply: Reply) -> str:
        """Store an answer to the question that is due; when this returns it is on disk.

        Returns
        -------
        str
            As it was stored; "n/a" if the time for the question was over.

        Raises
        ------
        InputError
            If it is no answer to the question; the question stays due.
        """
        step = self._expect("ask")
        question = step.question
        if question is None:
            raise DeviceStateError("session: expected a question to be due, got none")
        reaction = self._clock.elapsed() - self._since if reply.reaction_s is None else reply.reaction_s
        how: dict[str, Any] = {"reaction_s": round(reaction, 4), "by": reply.by}
        if question.timeout_s and (reply.late or reaction > question.timeout_s):
            self._write("late", trial=step.code, question=question.name, said=reply.text, **how)
            self._advance()
            return "n/a"
        said = question.read(reply.text)
        if step.code:
            self._write("answer", trial=step.code, question=question.name, answer=said, **how)
        else:
            self._write("form", question=question.name, answer=said)
        self._advance()
        return said

    def stop(self, reason: str) -> None:
        """Emergency stop: silence first, then a line in the log. From any thread, at any time."""
        with self._ending:
            self._stopped.set()
            self._presenter.silence()
            if self._entered:
                self._write("stop", reason=reason)

    def _make_felt(self, stimulus: Stimulus, text: str, cue: Callable[[str], None]) -> None:
        """Present a stimulus, or the members of a pair with the gap between them."""
        names = stimulus.members or (stimulus.name,)
        for place, name in zip(("first", "second"), names, strict=False):
            if place == "second":
                self._clock.wait(stimulus.gap_s, self._stopped)
            if self._stopped.is_set():
                return
            if text:
                cue(f"{text} {place.capitalize()}." if stimulus.members else text)
            self._presenter.present(self.plan.design.stimulus(name))
        if text:
            cue("")

    def _failed(self, step: TrialStep, wrong: DeviceError) -> None:
        """Take down that a trial was not felt as it should, and make it due again if the array can still play."""
        if self._stopped.is_set():
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
        name = next_stimulus(self.plan, self.standing(), trial)
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


def _to_nobody(_text: str) -> None:
    """No screen shows a cue."""


def run(session: Session, screen: Screen) -> TrialStep:
    """Drive a session that was entered to its end, or to a stop.

    Returns
    -------
    Step
        Of kind "done" or "stopped".
    """
    while (step := session.step).kind not in ("done", "stopped"):
        if step.kind == "present":
            session.present(screen.cue)
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
