"""Play what was admitted with everything that keeps it safe: a log, a way to stop it, silence at the end."""

import _thread
import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

from midair.devices import Admission, ArrayDevice, PlayReport, log_end, log_order, stop_line
from midair.model import Progress
from midair.rig.signals import ENDING, handled


def play_admitted(
    admission: Admission,
    array: ArrayDevice,
    *,
    source: str,
    delay: float = 0.0,
    progress: Progress | None = None,
) -> PlayReport:
    """Play on an open array what has been admitted on it.

    The order is in the log before the first sound, and its end after the last. SIGTERM and SIGHUP end the program as
    Ctrl-C does, which silences the array on the way out; so does `stop_playing` from another terminal.

    Parameters
    ----------
    admission : Admission
        What `admit` gave for this array.
    array : ArrayDevice
        Open.
    source : str
        What to call the drive in the log.
    delay, progress
        As in `ArrayDevice.play`.
    """
    log_order(source, array.name, admission)

    def stop() -> None:
        # Silence first, then the end of the program, which may take its time.
        array.silence()
        _thread.interrupt_main()

    try:
        with signals_end_the_program(), stop_line(array.name, stop):
            report = array.play(admission, delay=delay, progress=progress)
    except BaseException as end:
        log_end(source, array.name, None, f"{type(end).__name__}: {end}".rstrip(": "))
        raise
    log_end(source, array.name, report, "played")
    return report


@contextmanager
def signals_end_the_program() -> Generator[None]:
    """While inside, SIGTERM and SIGHUP leave through every `with` and `finally`, as an error does."""

    def leave(number: int, _: FrameType | None) -> None:
        for each in ENDING:
            signal.signal(each, signal.SIG_IGN)  # a second one must not interrupt the silencing
        # The status by which shells know that a signal ended a program.
        sys.exit(128 + number)

    with handled(ENDING, leave):
        yield
