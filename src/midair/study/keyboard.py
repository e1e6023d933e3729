"""Single key presses at a terminal with their times."""

import os
import select
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic

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
