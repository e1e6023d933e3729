"""Play what was admitted, and be silent when a signal ends the program."""

import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from midair.devices import ArrayDevice, ExposureClearance, PlayReport
from midair.model import Medium, Progress
from midair.rig.signals import ENDING, handled


def play_cleared(
    admission: ExposureClearance,
    array: ArrayDevice,
    *,
    source: str | Path,
    delay: float = 0.0,
    progress: Progress | None = None,
    room: Medium | None = None,
) -> PlayReport:
    """Play on an open array what has been admitted on it.

    SIGTERM and SIGHUP end the program as Ctrl-C does, which silences the array on the way out. It is
    logged, and `midair stop` reaches it, also where nobody can hear it: see `ArrayDevice.play`.

    Parameters
    ----------
    admission : Admission
        What `admit` gave for this array.
    array : ArrayDevice
        Open.
    source : str or Path
        What to call the drive in the log; a file is hashed there.
    delay, progress, room
        As in `ArrayDevice.play`.
    """
    with signals_end_the_program():
        return array.play(admission, source=source, delay=delay, progress=progress, watched=True, room=room)


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
