"""Screen of a study session at a terminal, with its keys and stop signals."""

import os
import select
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic
from types import FrameType

from rich.console import Console
from rich.markup import escape

from midair.errors import InputError
from midair.files import printable
from midair.rig import END_SIGNALS, handle_signals
from midair.study.design import Question
from midair.study.session import Reply, TrialStep

if sys.platform != "win32":
    import termios
    import tty

ARROWS = {b"\x1b[D": "left", b"\x1b[C": "right", b"\x1b[B": "down", b"\x1b[A": "up"}
"""Escape sequences of the arrow keys; in application mode terminals send O instead of the bracket."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyboard:
    """Key presses of a terminal without Enter; Ctrl-C still interrupts."""

    file: int
    """File descriptor of the terminal."""

    @contextmanager
    def listening(self) -> Generator[None]:
        """Context in which keys are read one by one without echo; earlier input is discarded."""
        before = termios.tcgetattr(self.file)
        try:
            tty.setcbreak(self.file, termios.TCSAFLUSH)
            yield
        finally:
            termios.tcsetattr(self.file, termios.TCSADRAIN, before)

    def key(self, until: float | None = None) -> str:
        """Next key: a character, "left", "right", "up", "down" or "enter"; empty if none came until the time limit.

        `until` is a monotonic time in s; without limit if None. Raises EOFError if the terminal is closed.
        """
        if not select.select([self.file], [], [], None if until is None else max(0.0, until - monotonic()))[0]:
            return ""
        typed = self._one()
        arrow = ARROWS.get(typed.replace(b"\x1bO", b"\x1b["))
        return arrow or ("enter" if typed[:1] in b"\r\n" else typed.decode(errors="replace")[:1])

    def _one(self) -> bytes:
        """Bytes of one key, also if several keys arrive together."""
        typed = os.read(self.file, 1)
        if not typed:
            raise EOFError
        more = 2 if typed == b"\x1b" else sum(typed[0] >= least for least in (0xC0, 0xE0, 0xF0))
        while more and select.select([self.file], [], [], 0.02)[0]:
            typed, more = typed + os.read(self.file, 1), more - 1
        return typed

    def line_in(self, seconds: float) -> bool:
        """Whether Enter is pressed within this time; other input is discarded."""
        if select.select([self.file], [], [], seconds)[0]:
            return True
        termios.tcflush(self.file, termios.TCIFLUSH)
        return False


def keyboard_of_terminal() -> Keyboard | None:
    """Keyboard of the program's terminal; None without a terminal or on Windows."""
    if sys.platform == "win32" or not sys.stdin.isatty():
        return None
    return Keyboard(file=sys.stdin.fileno())


class TerminalScreen:
    """Screen for participant and experimenter at one terminal; never shows a condition.

    Questions with single-key answers and sliders use `keyboard`; without one, lines are read from `console`.
    """

    def __init__(self, console: Console, keyboard: Keyboard | None = None) -> None:
        self._console = console
        self._keyboard = keyboard

    def show(self, text: str) -> None:
        """Show a text until Enter."""
        self._console.print(f"\n{plain_text(text)}")
        self._console.input("[dim]Press Enter to continue, Ctrl-C to stop at any time[/] ")

    def rest(self, step: TrialStep) -> None:
        """Wait until the shortest break is over and Enter is pressed."""
        end = monotonic() + step.rest_s
        self._console.print(f"\nPlease rest for at least {step.rest_s:g} s.")
        while True:
            self._console.input("[dim]Press Enter to continue[/] ")
            if monotonic() >= end:
                return
            self._console.print(f"Please rest for another {end - monotonic():.0f} s.")

    def cue(self, text: str) -> None:
        """Show the cue of a stimulus."""
        if text:
            self._console.print(f"\n[bold]{plain_text(text)}[/]")

    def present_text(self, text: str) -> None:
        """Show a text as the stimulus; an empty one clears the screen."""
        self._console.clear()
        if text:
            self._console.print(f"\n{plain_text(text)}")

    def ask(self, step: TrialStep) -> Reply:
        """Ask a question, and read a key or a line."""
        question = step.question
        if question is None:
            raise InputError("terminal: expected a step with a question, got none")
        place = f"[bold]{step.number} of {step.total}[/] " if step.code else ""
        self._console.print(f"\n{place}{plain_text(question.text)}")
        for line in _menu(question):
            self._console.print(f"  {plain_text(line)}")
        if self._keyboard and question.keys:
            return self._read_key(self._keyboard, question)
        if self._keyboard and question.kind == "slider":
            return self._read_slider(self._keyboard, question)
        self._console.print("> ", end="")
        if self._keyboard and question.timeout_s and not self._keyboard.line_in(question.timeout_s):
            return Reply(text="", reaction_s=question.timeout_s, by="line", late=True)
        return Reply(text=self._console.input(""), by="line")

    def _read_key(self, keyboard: Keyboard, question: Question) -> Reply:
        """Answer of a single key, with its reaction time."""
        with keyboard.listening():
            self._console.print(f"Press {plain_text(', '.join(question.keys))}")
            begin = monotonic()
            until = begin + question.timeout_s if question.timeout_s else None
            while key := keyboard.key(until):
                reaction = monotonic() - begin
                if key in question.keys:
                    self._console.print(f"> {plain_text(question.keys[key])}")
                    return Reply(text=question.keys[key], reaction_s=reaction, by="key")
            return Reply(text="", reaction_s=question.timeout_s, by="key", late=True)

    def _read_slider(self, keyboard: Keyboard, question: Question) -> Reply:
        """Position of the slider at Enter; an arrow key must come first."""
        moves = {"left": -0.01, "right": 0.01, "down": -0.1, "up": 0.1}
        share, text = None, ""
        with keyboard.listening():
            self._console.print("Arrow keys: left and right move by 1 %, down and up by 10 %; then press Enter")
            begin = monotonic()
            until = begin + question.timeout_s if question.timeout_s else None
            while key := keyboard.key(until):
                if key in moves:
                    share = min(max((0.5 if share is None else share) + moves[key], 0), 1)
                    text = f"{question.low + share * (question.high - question.low):g}"
                    bar = f"{'-' * round(40 * share)}#{'-' * (40 - round(40 * share))}"
                    self._console.print(f"  |{bar}|  {text}   ", end="\r")
                if key == "enter" and share is not None:
                    self._console.print("")
                    return Reply(text=text, reaction_s=monotonic() - begin, by="key")
            return Reply(text="", reaction_s=question.timeout_s, by="key", late=True)

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Print a message if the time limit passed; nothing else, since feedback would bias the answers."""
        if step.question and step.question.timeout_s and answer == "n/a":
            self._console.print(f"No answer within {step.question.timeout_s:g} s.")

    def refused(self, step: TrialStep, why: str) -> None:
        """Print the reason why the answer is invalid."""
        self._console.print(f"trial {step.number}: {plain_text(why)}")


@contextmanager
def stop_on_signals() -> Generator[None]:
    """Handle termination signals like Ctrl-C: the session silences the array and stops."""

    def stop(number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    with handle_signals(END_SIGNALS, stop):
        yield


def _menu(question: Question) -> list[str]:
    """Possible answers, line by line."""
    if question.kind in ("rating", "slider"):
        return [f"{question.low}: {question.low_label}, {question.high}: {question.high_label}"]
    if question.kind == "magnitude":
        return ["any number of 0 or more"]
    if question.numbered:
        return [f"{number}  {option}" for number, option in enumerate(question.answers, start=1)]
    # The options are numbers themselves: line numbers would look like answers.
    return list(question.answers)


def plain_text(text: str) -> str:
    """Text of a plan or an answer, without markup and escape sequences."""
    return escape(printable(text))
