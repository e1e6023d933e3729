"""Handle signals that end the program."""

import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

Handler = Callable[[int, FrameType | None], object]
END_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that request the end of the program or report a closed terminal, where the system has them."""


@contextmanager
def handle_signals(numbers: tuple[int, ...], handler: Handler) -> Generator[None]:
    """Send these signals to `handler` inside the context, and restore the earlier handlers afterwards.

    Python handles signals in the main thread only: in any other thread, nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextmanager
def signals_end_the_program() -> Generator[None]:
    """Inside the context, SIGTERM and SIGHUP leave through every `with` and `finally`, as an error does."""

    def leave(number: int, _: FrameType | None) -> None:
        for each in END_SIGNALS:
            signal.signal(each, signal.SIG_IGN)  # a second one must not interrupt the silencing
        # Exit status by which shells recognise a program that a signal ended.
        sys.exit(128 + number)

    with handle_signals(END_SIGNALS, leave):
        yield
