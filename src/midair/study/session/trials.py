"""Session of one participant, independent of the screen.

A `Session` is a state machine: `step` is the current step, and `acknowledge`, `present`, `answer` and `stop` advance
it. `run` is a loop that drives it with a `Screen`. No step reveals the condition.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from itertools import chain
from pathlib import Path
from threading import Event, RLock
from time import monotonic
from typing import Any, Literal, Protocol, Self

from midair.errors import DeviceError, DeviceStateError, InputError, SilentFramesError
from midair.model import Medium
from midair.study.design.adaptive_block import next_stimulus
from midair.study.design.plan import Plan, Trial
from midair.study.design.question import Question, Stimulus
from midair.study.design.session_state import SessionState, replay, right_answer_of_trial
from midair.study.design.study_design import Design
from midair.study.event_markers import EventMarkers, MarkerKind
from midair.study.session.event_log import EventLog, read_events
from midair.study.session.presenters import Presenter, SilentPresenter


class Clock:
    """Clock of this computer."""

    def now(self) -> str:
        """Date and time in UTC, ISO 8601."""
        return datetime.now(UTC).isoformat(timespec="milliseconds")

    def elapsed(self) -> float:
        """Monotonic time, in s."""
        return monotonic()

    def wait(self, seconds: float, ended: Event) -> None:
        """Return after this time in s, or as soon as `ended` is set."""
        ended.wait(seconds)


class InstantClock(Clock):
    """Clock for simulated participants, without waiting."""

    def wait(self, seconds: float, ended: Event) -> None:
        """Return at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialStep:
    """The current step of a session, without the condition."""

    kind: Literal["show", "present", "ask", "rest", "done", "stopped"]
    """A text to read; a stimulus to present; a question; a break; the end of the session; the end after a stop."""
    text: str = ""
    """Text to show; for "present" the cue when the stimulus starts."""
    code: str = ""
    """Code of the trial; empty for questions of the form."""
    number: int = 0
    """Number of the trial within the session."""
    total: int = 0
    """Number of trials in the session."""
    question: Question | None = None
    rest_s: float = 0.0
    """Shortest break, in s."""
    consent: Literal["", "take part", "go on"] = ""
    """Agreement that a participant gives by continuing after the text; the log records it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """Answer of a participant."""

    text: str
    """Typed or chosen text."""
    reaction_s: float | None = None
    """Reaction time measured by the screen, in s; None if the session measures it."""
    by: str = ""
    """How the time was measured: "key" (key press), "line" (Enter after a line), "page", "model"."""
    late: bool = False
    """Whether the time limit passed without an answer."""


class Screen(Protocol):
    """Display for participant and experimenter."""

    def show(self, text: str) -> None:
        """Show a text; return when it has been read."""
        ...

    def rest(self, step: TrialStep) -> None:
        """Return when the break is over."""
        ...

    def cue(self, text: str) -> None:
        """Show the cue of a stimulus; an empty text ends it."""
        ...

    def ask(self, step: TrialStep) -> Reply:
        """Ask the question of the step."""
        ...

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Confirm the stored answer; "n/a" if the time limit passed."""
        ...

    def refused(self, step: TrialStep, why: str) -> None:
        """Reject an invalid answer; the question is repeated."""
        ...


GO_ON = "The session was stopped. Continue only if you agree to go on."


def steps_of(plan: Plan, progress: Callable[[], SessionState]) -> Iterator[TrialStep]:
    """Steps from the current state of a session to its end; `progress` returns the state at any time."""
    design, begun = plan.design, progress()
    first, trials = begun.next_trial, begun.trials
    if first == len(trials):
        return
    if begun.stopped:
        yield TrialStep(kind="show", text=GO_ON, consent="go on")
    if design.consent:
        yield TrialStep(kind="show", text=design.consent, consent="take part")
    for name in design.form:
        if name not in begun.form:
            yield TrialStep(kind="ask", question=design.question(name))
    last = max(index for index, trial in enumerate(trials) if trial.session == trials[first].session)
    done = 0
    for index in range(first, last + 1):
        now = progress() if design.block(trials[index].block).criterion else begun
        if now.open_questions(trials[index]):
            yield from _before(design, trials, index, first, done)
            yield from _trial(plan, trials[index], len(trials), now, progress)
            done += 1
    if design.debrief and last + 1 == len(trials):
        yield TrialStep(kind="show", text=design.debrief)


def _before(design: Design, trials: Sequence[Trial], index: int, first: int, done: int) -> Iterator[TrialStep]:
    block = design.block(trials[index].block)
    earlier = design.block(trials[index - 1].block) if index > first else None
    within = index - next(place for place, trial in enumerate(trials) if trial.block == block.name)
    if earlier is not None and earlier.name != block.name and earlier.rest_s and done:
        yield TrialStep(kind="rest", rest_s=earlier.rest_s, number=index, total=len(trials))
    elif earlier is not None and block.break_every and within and within % block.break_every == 0:
        yield TrialStep(kind="rest", rest_s=block.rest_s, number=index, total=len(trials))
    if block.text and (earlier is None or earlier.name != block.name):
        yield TrialStep(kind="show", text=block.text)


def _trial(
    plan: Plan, trial: Trial, total: int, now: SessionState, progress: Callable[[], SessionState]
) -> Iterator[TrialStep]:
    design = plan.design
    place: dict[str, Any] = {"code": trial.code, "number": trial.number, "total": total}
    yield TrialStep(kind="present", text=design.cue, **place)
    for name in now.open_questions(trial):
        yield TrialStep(kind="ask", question=design.question(name).in_order_of(trial.code, seed=design.seed), **place)
    if design.block(trial.block).feedback:
        yield TrialStep(kind="show", text=_feedback(plan, trial, progress()), **place)


def _feedback(plan: Plan, trial: Trial, now: SessionState) -> str:
    # The first question of the block, in any order of the trial.
    name = min(trial.questions, key=(*plan.design.block(trial.block).questions, *trial.questions).index)
    right = right_answer_of_trial(plan, trial, now.chosen, name)
    if not right:
        return "This question has no correct answer."
    return "Correct." if now.answers[trial.code, name].answer == right else f"Wrong. The correct answer is {right}."


ATTEMPTS = 3
"""Number of failed presentations in a row that end the session."""

AGAIN = "The device interrupted the last presentation. It will be repeated from the beginning."


class Session:
    """Session of one participant; a context manager that silences the presenter on every exit.

    Raises MismatchError on entering, if the log follows another plan; BrokenFileError on entering, if it is damaged.

    Participants are numbered from 1, and an existing `log` with answers is continued: the unfinished trial is presented
    again and asks only unanswered questions. `simulated` (a simulated participant takes part) is stored in the log and
    all results, `room` (the air, None if unknown) in the log, `about` as further fields of its "open" event, such as
    the masking noise. `clock` is the computer's by default. Open outputs in `markers` get a marker at each trial,
    stimulus and answer.
    """

    def __init__(
        self,
        plan: Plan,
        participant: int,
        log: Path,
        presenter: Presenter,
        *,
        simulated: bool = False,
        room: Medium | None = None,
        clock: Clock | None = None,
        about: Mapping[str, Any] | None = None,
        markers: EventMarkers | None = None,
    ) -> None:
        self.plan = plan
        self.participant = participant
        # Simulated answers need no sync: the model would give the same ones again.
        self._log = EventLog(log, synced=not isinstance(presenter, SilentPresenter))
        self._presenter = presenter
        self._simulated = simulated
        self._room = None if room is None else {"temperature_c": room.temperature, "humidity": room.humidity}
        self._clock = clock or Clock()
        self._about = dict(about or {})
        self._markers = markers
        self._stopped = Event()
        self._entered = False
        self._ending = RLock()  # a stop from another thread is logged before the log closes
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
                self._write("resume")
        except BaseException:
            self._log.close()
            raise
        self._trials = {trial.code: trial for trial in before.trials}
        self._script = steps_of(self.plan, self.standing)
        self._entered = True
        self._advance()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
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
        """Current step."""
        return TrialStep(kind="stopped") if self._stopped.is_set() else self._step

    @property
    def log(self) -> Path:
        """File of the log."""
        return self._log.path

    def standing(self) -> SessionState:
        """State of the session, computed from its log."""
        return replay(read_events(self._log.path), self.plan, self.participant)

    def acknowledge(self) -> None:
        """Continue after a text was read, which is logged if it asks for consent, or a break is over."""
        step = self._expect("show", "rest")
        if step.consent:
            self._write("consent", to=step.consent, sha256=sha256(step.text.encode()).hexdigest())
        self._advance()

    def present(self, cue: Callable[[str], None] | None = None) -> None:
        """Present the stimulus of the current step after its planned delay; return when it has ended.

        `cue` is called with the cue when a stimulus begins, and with "" after the last one. If the array did not play
        it completely, the failure is logged and the trial is repeated after a message to the participant; after
        `ATTEMPTS` failures in a row SilentFramesError is raised.
        """
        step = self._expect("present")
        trial = self._trials[step.code]
        self._mark("trial", step.code)
        stimulus = self._due(trial)
        try:
            self._clock.wait(trial.wait_s, self._stopped)
            self._present_members(stimulus, step.text, cue or (lambda _: None))
        except DeviceError as wrong:
            if self._stopped.is_set():
                raise wrong
            self._write("silent", trial=step.code, reason=str(wrong))
            self._silences += 1
            if not isinstance(wrong, SilentFramesError):
                raise wrong
            if self._silences == ATTEMPTS:
                raise SilentFramesError(
                    f"trial {step.number}: the array failed {ATTEMPTS} times in a row, the session ends; {wrong}"
                ) from wrong
            self._script = chain([step], self._script)
            self._step = TrialStep(kind="show", text=AGAIN)
            return
        if not self._stopped.is_set():
            self._silences = 0
            self._write("presented", trial=step.code)
            self._advance()

    def answer(self, reply: Reply) -> str:
        """Store the answer to the current question on disk and return it, "n/a" after the time limit.

        Raises InputError if the text is no valid answer; the question stays current.
        """
        step = self._expect("ask")
        question = step.question
        if question is None:
            raise DeviceStateError("session: expected a current question, got none")
        reaction = self._clock.elapsed() - self._since if reply.reaction_s is None else reply.reaction_s
        how: dict[str, Any] = {"reaction_s": round(reaction, 4), "by": reply.by}
        how |= {"options": list(question.options)} if question.shuffle else {}
        if question.timeout_s and (reply.late or reaction > question.timeout_s):
            self._write_marked("late", trial=step.code, question=question.name, said=reply.text, **how)
            self._advance()
            return "n/a"
        said = question.read(reply.text)
        if step.code:
            self._write_marked("answer", trial=step.code, question=question.name, answer=said, **how)
        else:
            self._write("form", question=question.name, answer=said)
        self._advance()
        return said

    def stop(self, reason: str) -> None:
        """Emergency stop: silence the presenter, then log the reason. Callable from any thread at any time."""
        with self._ending:
            self._stopped.set()
            self._presenter.silence()
            if self._entered:
                self._write("stop", reason=reason)

    def _present_members(self, stimulus: Stimulus, text: str, cue: Callable[[str], None]) -> None:
        """Present a stimulus, or the members of a pair with the gap between them."""
        names = stimulus.members or (stimulus.name,)
        for place, name in zip(("first", "second"), names, strict=False):
            if place == "second":
                self._clock.wait(stimulus.gap_s, self._stopped)
            if self._stopped.is_set():
                return
            if text:
                cue(f"{text} {place.capitalize()}." if stimulus.members else text)
            shown = self.plan.design.stimulus(name)
            self._presenter.present(shown, lambda code=shown.code: self._mark("stimulus", code=code))
        if text:
            cue("")

    def _due(self, trial: Trial) -> Stimulus:
        """Stimulus of a trial; the choice of an adaptive block is logged before the presentation."""
        name = trial.stimulus or next_stimulus(self.plan, self.standing(), trial)
        self._write("present", trial=trial.code, **({} if trial.stimulus else {"stimulus": name}))
        return self.plan.design.stimulus(name)

    def _expect(self, *kinds: str) -> TrialStep:
        if not self._entered:
            raise DeviceStateError("session: expected an entered session; use it as a context manager")
        if self.step.kind not in kinds:
            raise DeviceStateError(f"session: expected the step {' or '.join(kinds)}, got {self.step.kind}")
        return self.step

    def _advance(self) -> None:
        self._step = next(self._script, TrialStep(kind="done"))
        self._since = self._clock.elapsed()
        if self._step.kind == "done":
            self._write("done")

    def _mark(self, kind: MarkerKind, trial: str = "", *, code: int = 0) -> None:
        if self._markers is not None:
            self._markers.send(kind, trial, code=code)

    def _write_marked(self, event: Literal["answer", "late"], *, trial: str, **fields: Any) -> None:
        """Send the marker of an answer, then log the answer, even if the marker failed."""
        try:
            if trial:
                self._mark(event, trial)
        finally:
            self._write(event, trial=trial, **fields)

    def _write(self, event: str, **fields: Any) -> None:
        for marker in self._markers.take() if self._markers is not None else ():
            self._log.append({"event": "marker", **marker})
        self._log.append({"event": event, **fields, "time": self._clock.now()})


def run(session: Session, screen: Screen) -> TrialStep:
    """Drive an entered session to its end or to a stop; return the last step, "done" or "stopped"."""
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
