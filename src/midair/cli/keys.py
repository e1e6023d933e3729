"""Single keys from a terminal, and signals that request an orderly stop."""

import contextlib
import os
import select
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from time import monotonic
from types import FrameType
from typing import Any, Self, TextIO

from midair import devices


class Keys:
    """Keys as they are pressed, without Enter; none without a terminal, which the end of the block restores."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stdin if stream is None else stream
        self._before: list[Any] | None = None
        self._file = -1

    @property
    def active(self) -> bool:
        """Whether keys can be read."""
        return self._before is not None

    def __enter__(self) -> Self:
        with contextlib.suppress(ImportError, OSError, ValueError):
            import termios
            import tty

            if self._stream.isatty():
                self._file = self._stream.fileno()
                try:
                    self._before = termios.tcgetattr(self._file)
                    tty.setcbreak(self._file, termios.TCSANOW)
                except termios.error:
                    self._before = None
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

            before, self._before = self._before, None
            with contextlib.suppress(termios.error, OSError):  # the terminal may be gone
                termios.tcsetattr(self._file, termios.TCSADRAIN, before)

    def pressed(self) -> str:
        """Keys pressed since the last call; never waits."""
        keys = b""
        while self.active and select.select([self._file], [], [], 0)[0]:
            more = os.read(self._file, 64)
            if not more:
                break
            keys += more
        return keys.decode("utf-8", "replace")

    def next(self, until: float | None = None) -> str:
        """Next keys; empty if none came until the time limit, a monotonic time in s, without limit if None.

        Raises EOFError if the terminal is closed.
        """
        if not select.select([self._file], [], [], None if until is None else max(0.0, until - monotonic()))[0]:
            return ""
        if not (keys := self.pressed()):
            raise EOFError
        return keys


def line_in(terminal: TextIO, seconds: float) -> bool:
    """Whether Enter is pressed within this time; other input is discarded."""
    import termios

    if select.select([terminal], [], [], seconds)[0]:
        return True
    termios.tcflush(terminal, termios.TCIFLUSH)
    return False


class Signals:
    """Received signals; a second Ctrl-C raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.came: str = ""

    def catch(self, number: int, _frame: FrameType | None) -> None:
        """Remember a signal, so that the running take ends in order."""
        if self.came and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.came = signal.Signals(number).name


@contextmanager
def signals_noted() -> Generator[Signals]:
    """Note Ctrl-C, termination requests and a lost terminal instead of ending the program."""
    signals = Signals()
    with devices.handle_signals((signal.SIGINT, *devices.END_SIGNALS), signals.catch):
        yield signals
