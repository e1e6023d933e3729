"""What happens when a signal asks the program to end."""

import signal
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType

Handler = Callable[[int, FrameType | None], object]
ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that ask a program to end, and that its terminal is gone, where the system has them."""


@contextmanager
def handled(numbers: tuple[int, ...], handler: Handler) -> Generator[None]:
    """While inside, `handler` gets these signals; what handled them before does so again afterwards.

    Only the main thread may handle signals: in any other, nothing changes.
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
