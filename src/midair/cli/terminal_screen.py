"""Screen of a study session at a terminal, with its keys."""

from time import monotonic
from typing import TextIO

from rich.console import Console

from midair.cli.keys import Keys, line_in
from midair.errors import InputError
from midair.study import Question, Reply, TrialStep, plain_text


class TerminalScreen:
    """Screen for participant and experimenter at one terminal; never shows a condition.

    Questions with single-key answers use the keys of `terminal`; without one, lines are read from `console`.
    """

    def __init__(self, console: Console, terminal: TextIO | None = None) -> None:
        self._console = console
        self._terminal = terminal

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
        if self._terminal and question.keys:
            return self._read_key(self._terminal, question)
        self._console.print("> ", end="")
        if self._terminal and question.timeout_s and not line_in(self._terminal, question.timeout_s):
            return Reply(text="", reaction_s=question.timeout_s, by="line", late=True)
        return Reply(text=self._console.input(""), by="line")

    def _read_key(self, terminal: TextIO, question: Question) -> Reply:
        """Answer of a single key, with its reaction time; keys that were pressed before are discarded."""
        with Keys(terminal) as keys:
            keys.pressed()
            self._console.print(f"Press {plain_text(', '.join(question.keys))}")
            begin = monotonic()
            until = begin + question.timeout_s if question.timeout_s else None
            while typed := keys.next(until):
                reaction = monotonic() - begin
                if key := next(filter(question.keys.get, typed), ""):
                    self._console.print(f"> {plain_text(question.keys[key])}")
                    return Reply(text=question.keys[key], reaction_s=reaction, by="key")
            return Reply(text="", reaction_s=question.timeout_s, by="key", late=True)

    def accepted(self, step: TrialStep, answer: str) -> None:
        """Print a message if the time limit passed; nothing else, since feedback would bias the answers."""
        if step.question and step.question.timeout_s and answer == "n/a":
            self._console.print(f"No answer within {step.question.timeout_s:g} s.")

    def refused(self, step: TrialStep, why: str) -> None:
        """Print the reason why the answer is invalid."""
        self._console.print(f"trial {step.number}: {plain_text(why)}")


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
