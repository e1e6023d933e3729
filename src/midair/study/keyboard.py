"""Single keys at a terminal, with the moment at which each came; where a terminal can give them."""

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
"""What terminals send for the arrow keys; in application mode with O in place of the bracket."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyboard:
    """The keys of a terminal, one by one and without Enter. Ctrl-C still interrupts.

    Attributes
    ----------
    file : int
        Descriptor of the terminal.
    """

    file: int

    @contextmanager
    def listening(self) -> Generator[None]:
        """While inside, keys come one by one and are not shown; what was typed before is forgotten."""
        before = termios.tcgetattr(self.file)
        try:
            tty.setcbreak(self.file, termios.TCSAFLUSH)
            yield
        finally:
            termios.tcsetattr(self.file, termios.TCSADRAIN, before)

    def key(self, until: float | None = None) -> str:
        """The next key: a letter, "left", "right", "up", "down", or "enter"; empty if none came.

        Parameters
        ----------
        until : float, optional
            Monotonic time to wait for, in s; without end if None.

        Raises
        ------
        EOFError
            If the terminal is gone.
        """
        if not select.select([self.file], [], [], None if until is None else max(0.0, until - monotonic()))[0]:
            return ""
        typed = self._one()
        arrow = ARROWS.get(typed.replace(b"\x1bO", b"\x1b["))
        return arrow or ("enter" if typed[:1] in b"\r\n" else typed.decode(errors="replace")[:1])

    def _one(self) -> bytes:
        """The bytes of one key; of keys that come at once, each is one."""
        typed = os.read(self.file, 1)
        if not typed:
            raise EOFError
        more = 2 if typed == b"\x1b" else sum(typed[0] >= least for least in (0xC0, 0xE0, 0xF0))
        while more and select.select([self.file], [], [], 0.02)[0]:
            typed, more = typed + os.read(self.file, 1), more - 1
        return typed

    def line_in(self, seconds: float) -> bool:
        """Whether somebody presses Enter within so many seconds; what was typed without is forgotten."""
        if select.select([self.file], [], [], seconds)[0]:
            return True
        termios.tcflush(self.file, termios.TCIFLUSH)
        return False


def keyboard_of_terminal() -> Keyboard | None:
    """The keyboard of the terminal in which the program runs; None where there is none, or it gives lines only."""
    if sys.platform == "win32" or not sys.stdin.isatty():
        return None
    return Keyboard(file=sys.stdin.fileno())
