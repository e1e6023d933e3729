"""What a session does step by step, and what a screen has to show of it. No step tells the condition."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Event
from time import monotonic
from typing import Any, Literal, Protocol

from midair.study.design import Design, Plan, Question, SessionState, Trial, right_of


class Clock(Protocol):
    """Time, as an argument."""

    def now(self) -> str:
        """Date and time, ISO 8601."""
        ...

    def elapsed(self) -> float:
        """A time that never goes back, in s."""
        ...

    def wait(self, seconds: float, ended: Event) -> None:
        """Return after so many seconds, or as soon as `ended` is set."""
        ...


class SystemClock:
    """The clock of this computer."""

    def now(self) -> str:
        """Date and time in UTC, ISO 8601."""
        return datetime.now(UTC).isoformat(timespec="milliseconds")

    def elapsed(self) -> float:
        """Monotonic time, in s."""
        return monotonic()

    def wait(self, seconds: float, ended: Event) -> None:
        """Return after so many seconds, or as soon as `ended` is set."""
        ended.wait(seconds)


class StillClock(SystemClock):
    """The clock of simulated participants, who wait for nothing."""

    def wait(self, seconds: float, ended: Event) -> None:
        """Return at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialStep:
    """What is due, without a word on the condition.

    Attributes
    ----------
    kind : {"show", "present", "ask", "rest", "done", "stopped"}
        A text to read; a stimulus to present; a question; a break; the end of the session; the end by a stop.
    text : str
        To show; of a "present" what the participant is told when the stimulus comes.
    code : str
        Of the trial, if it belongs to one; a question without one is of the form.
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
    """What somebody said.

    Attributes
    ----------
    text : str
        As it was typed or chosen.
    reaction_s : float, optional
        Only where the screen has measured it better than the session can, in s.
    by : str
        How: "key" (the moment of one key), "line" (of the Enter after it), "page", "model".
    late : bool
        Whether the time for the question ran out before anything was said.
    """

    text: str
    reaction_s: float | None = None
    by: str = ""
    late: bool = False


class Screen(Protocol):
    """What participant and experimenter see."""

    def show(self, text: str) -> None:
        """Show a text; return when it has been read."""
        ...

    def rest(self, step: TrialStep) -> None:
        """Return when the break is over."""
        ...

    def cue(self, text: str) -> None:
        """Tell at once that a stimulus comes now; the text is empty when it is over."""
        ...

    def ask(self, step: TrialStep) -> Reply:
        """Ask the question of the step."""
        ...

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Tell that the answer is stored; "n/a" where none came in time."""
        ...

    def refused(self, step: TrialStep, why: str) -> None:
        """Tell that it was no answer; the question comes again."""
        ...


def steps_of(plan: Plan, progress: Callable[[], SessionState]) -> Iterator[TrialStep]:
    """What is due from where a session stands until it is over, one step after the other.

    Parameters
    ----------
    plan : Plan
        That the session follows.
    progress : callable
        Where it stands now: a criterion that was met since ends its block.
    """
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
    """The break that is due before a trial, and what is told before a block."""
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
    """Whether the answer to the first question was right, and what would have been."""
    name = trial.questions[0]
    right = right_of(plan, trial, now.chosen, name)
    if not right:
        return "No answer is right or wrong here."
    return "Right." if now.answers[trial.code, name].answer == right else f"Wrong: it was {right}."
