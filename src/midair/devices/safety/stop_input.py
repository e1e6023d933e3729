"""A hardware stop: a byte, the end or the loss of an input silences every array, as `midair stop` does."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Literal

from midair.devices.safety.stop_channel import stop_playing
from midair.errors import DeviceError, InputError, MidairError

STEP = 0.02
"""Interval in s at which the lines of a serial port are read."""

AGAIN = 0.1
"""Interval in s at which playback is stopped again while the input is lost."""


class StopInput:
    """An open input; created by `open_stop_input`."""

    def __init__(self, name: str, handle: int) -> None:
        self.name, self._handle = name, handle
        self._lines = _control_lines(handle)

    def wait(self, over: threading.Event | None = None) -> Literal["byte", "lost"] | None:
        """Wait for a byte or for the loss of the input; None once `over` is set."""
        import select

        waiting = select.poll()
        waiting.register(self._handle, select.POLLIN)
        while over is None or not over.is_set():
            if _control_lines(self._handle) != self._lines:
                return "lost"
            if waiting.poll(1e3 * STEP):
                try:
                    return "byte" if os.read(self._handle, 4096) else "lost"
                except BlockingIOError:
                    continue
                except OSError:
                    return "lost"
        return None


@contextmanager
def open_stop_input(name: str) -> Generator[StopInput]:
    """Open an input by its name: ``serial:PORT``, ``keyboard`` or ``evdev:PATH``.

    Raises InputError if the name is none of these, DeviceError if it cannot be opened.
    """
    if sys.platform == "win32":
        raise DeviceError("--stop-input: expected Linux or macOS, got Windows; use midair stop")
    kind, _, path = name.partition(":")
    path = "/dev/tty" if name == "keyboard" else path
    if kind not in ("serial", "evdev", "keyboard") or not path:
        raise InputError(f"--stop-input: expected serial:PORT, keyboard or evdev:PATH, got {name!r}")
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    except OSError as wrong:
        raise DeviceError(
            f"{name}: expected an input for the hardware stop, got {wrong.strerror}; nothing plays without it"
        ) from wrong
    try:
        with _unbuffered(handle, keyboard=name == "keyboard"):
            yield StopInput(name, handle)
    finally:
        os.close(handle)


@contextmanager
def stop_on_input(name: str | None) -> Generator[None]:
    """While inside, a byte of the input or its loss stops everything that plays; no effect if `name` is None.

    After a loss, anything that starts to play is stopped again.
    """
    if name is None:
        yield
        return
    with open_stop_input(name) as opened:
        over = threading.Event()
        watch = threading.Thread(target=_watch, args=(opened, over), name="stop input", daemon=True)
        watch.start()
        try:
            yield
        finally:
            over.set()
            watch.join()


def _watch(opened: StopInput, over: threading.Event) -> None:
    while (cause := opened.wait(over)) is not None:
        # The programs are asked before an error of the state folder is raised.
        with contextlib.suppress(MidairError):
            stop_playing()
        if cause == "lost":
            time.sleep(AGAIN)


@contextmanager
def _unbuffered(handle: int, *, keyboard: bool) -> Generator[None]:
    """Deliver each byte of a terminal at once; Ctrl-C of a keyboard remains a signal."""
    if sys.platform == "win32" or not os.isatty(handle):
        yield
        return
    import termios
    import tty

    before = termios.tcgetattr(handle)
    (tty.setcbreak if keyboard else tty.setraw)(handle, termios.TCSANOW)
    try:
        yield
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(handle, termios.TCSANOW, before)


def _control_lines(handle: int) -> int | None:
    """States of CTS, DSR and DCD of a serial port; None if it has none."""
    if sys.platform == "win32":
        return None
    import fcntl
    import termios

    try:
        state = int.from_bytes(fcntl.ioctl(handle, termios.TIOCMGET, bytes(4)), sys.byteorder)
    except OSError:
        return None
    return state & (termios.TIOCM_CTS | termios.TIOCM_DSR | termios.TIOCM_CD)
