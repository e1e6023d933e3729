"""A study at a terminal: the screen, who presents, and signals that stop."""

import signal
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import lru_cache, partial
from time import monotonic
from types import FrameType

from rich.console import Console
from rich.markup import escape

from midair.devices import Admission, ExposureChoices, VirtualArray, admit
from midair.errors import InputError
from midair.files import load_solution, load_target, printable
from midair.model import Drive, Medium, TransducerArray
from midair.rig import ENDING, array_named, handled, room_air, usual_exposure
from midair.study.design import Plan
from midair.study.folder import StudyFolder
from midair.study.session import ArrayPresenter, ExperimenterPresenter, Presenter, Reply, TrialStep


class TerminalScreen:
    """Participant and experimenter at one terminal; never shows a condition.

    Parameters
    ----------
    console : Console
        To print to and to read from.
    """

    def __init__(self, console: Console) -> None:
        self._console = console

    def show(self, text: str) -> None:
        """Show a text until Enter."""
        self._console.print(f"\n{_plain(text)}")
        self._console.input("[dim]Enter to go on, Ctrl-C to stop at any time[/] ")

    def rest(self, step: TrialStep) -> None:
        """Hold the session until the shortest break is over and somebody presses Enter."""
        end = monotonic() + step.rest_s
        self._console.print(f"\nA break of at least {step.rest_s:g} s.")
        while True:
            self._console.input("[dim]Enter to go on[/] ")
            if monotonic() >= end:
                return
            self._console.print(f"Please rest for another {end - monotonic():.0f} s.")

    def ask(self, step: TrialStep) -> Reply:
        """Ask a question and read a line."""
        question = step.question
        if question is None:
            raise InputError("terminal: expected a question to ask, got none")
        self._console.print(f"\n[bold]{step.number} of {step.total}[/] {_plain(question.text)}")
        if question.kind == "rating":
            ends = f"{question.low}: {question.low_label}, {question.high}: {question.high_label}"
            self._console.print(f"  {_plain(ends)}")
        else:
            for number, option in enumerate(question.answers, start=1):
                self._console.print(f"  {number}  {_plain(option)}")
        return Reply(text=self._console.input("> "))

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Nothing: feedback would teach the answers."""

    def refused(self, step: TrialStep, why: str) -> None:
        """Say why the answer to this trial's question was none."""
        self._console.print(f"trial {step.number}: {_plain(why)}")


@contextmanager
def presenter_named(
    array: str,
    folder: StudyFolder,
    plan: Plan,
    *,
    exposure: ExposureChoices | None = None,
    room: Medium | None = None,
    before: Callable[[Drive], None] | None = None,
) -> Generator[Presenter]:
    """What presents: the experimenter, told on the error stream, or an array that plays drives beside the plan.

    Every drive passes the exposure gate before the session begins, which `before` is called with ahead of that, and
    each time it plays is in the log. The experimenter is told what the air of the room does to it.
    """
    console = Console(stderr=True, emoji=False)
    by_hand = ExperimenterPresenter(
        tell=lambda line: console.print(f"experimenter: {_plain(line)}"),
        done=lambda: _wait(console),
    )
    if array == "none":
        if drives := [stimulus.name for stimulus in plan.design.stimuli if stimulus.kind == "drive"]:
            raise InputError(f"array: expected one to play {len(drives)} drives of the plan, got none; give --array")
        yield by_hand
        return
    choices = exposure or usual_exposure()
    device = VirtualArray(TransducerArray.autd3()) if array == "virtual" else array_named(array)

    @lru_cache(maxsize=32)
    def admitted(source: str) -> Admission:
        drive = load_solution(folder.path / source).drive
        if before is not None:
            before(drive)
        return admit(drive, device, choices)

    with device:
        presenter = ArrayPresenter(array=device, admitted=admitted, by_hand=by_hand, room=room)
        presenter.check(plan.design.stimuli)
        for path in dict.fromkeys(folder.path / one.source for one in plan.design.stimuli if one.kind == "drive"):
            air = room_air(load_solution(path).drive, room, partial(load_target, path), simulated=device.simulated)
            console.print(_plain(f"{path.name}: {air.said}"), style="yellow" if air.warns else None)
            admission = admitted(str(path.relative_to(folder.path)))
            if admission.outcome == "attenuated":
                console.print(_plain(f"{path.name}: exposure {admission.verdict()}"), style="yellow")
        yield presenter


@contextmanager
def stops_on_signals() -> Generator[None]:
    """A request to end the program stops the session as Ctrl-C does: silence first."""

    def stop(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    with handled(ENDING, stop):
        yield


def _wait(console: Console) -> None:
    console.input("[dim]Enter when it was presented[/] ")


def _plain(text: str) -> str:
    """Words of a plan or an answer, which are no markup and no escape sequence."""
    return escape(printable(text))
