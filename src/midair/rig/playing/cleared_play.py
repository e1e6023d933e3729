"""Play cleared drives; a signal that ends the program silences the array."""

import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from midair.devices import ArrayDevice, ExposureClearance, PlayReport
from midair.model import Medium, Progress
from midair.rig.signals import END_SIGNALS, handle_signals


def play_cleared(
    admission: ExposureClearance,
    array: ArrayDevice,
    *,
    source: str | Path,
    delay: float = 0.0,
    progress: Progress | None = None,
    room: Medium | None = None,
) -> PlayReport:
    """Play a cleared drive on an open array.

    SIGTERM and SIGHUP end the program as Ctrl-C does, which silences the array. Playing is logged, and `midair stop`
    reaches it on every array. The arguments are those of `ArrayDevice.play`.
    """
    with signals_end_the_program():
        return array.play(admission, source=source, delay=delay, progress=progress, watched=True, room=room)


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
