"""Steps of a session and the protocol of the screens that show them. No step reveals the condition."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Event
from time import monotonic
from typing import Any, Literal, Protocol

from midair.study.design import Design, Plan, Question, SessionState, Trial, right_answer_of_trial


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


def steps_of(plan: Plan, progress: Callable[[], SessionState]) -> Iterator[TrialStep]:
    """Steps from the current state of a session to its end; `progress` returns the state at any time."""
    design, begun = plan.design, progress()
    first, trials = begun.next_trial, begun.trials
    if first == len(trials):
        return
    if design.consent:
        yield TrialStep(kind="show", text=design.consent)
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
    """Break and instruction that precede a trial."""
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
        yield TrialStep(kind="ask", question=design.question(name), **place)
    if design.block(trial.block).feedback:
        yield TrialStep(kind="show", text=_feedback(plan, trial, progress()), **place)


def _feedback(plan: Plan, trial: Trial, now: SessionState) -> str:
    """Feedback on the answer to the first question."""
    name = trial.questions[0]
    right = right_answer_of_trial(plan, trial, now.chosen, name)
    if not right:
        return "This question has no correct answer."
    return "Correct." if now.answers[trial.code, name].answer == right else f"Wrong. The correct answer is {right}."
