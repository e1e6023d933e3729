"""Lock of a device among programs; stop channel and hardware stop of an array, from the order to play on."""

import _thread
import contextlib
import errno
import hashlib
import os
import shlex
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Literal
from urllib.parse import quote, unquote

from midair.devices.safety.lock_files import LockFile, held_entry, make_state_folder, state_folder
from midair.devices.safety.stop_channel import open_stop_channel, stop_playing
from midair.errors import DeviceError, HeldError, InputError, MidairError, StoppedError

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


@contextmanager
def device_lock(device: str) -> Generator[None]:
    """While inside, no other program on this computer, and no other part of this one, can lock the device.

    The lock is a system lock on a file in the state folder, and on Linux also a socket name for the whole computer:
    both end with the process, and a leftover file does not block. On macOS, programs of other users, or with another
    state folder, get the device; on Windows every program does.

    Colons separate the parts of a name: ``autd3``, which may find any units, excludes ``autd3:eth0``, and vice versa.
    Raises HeldError if another program uses it, DeviceError if Linux refuses the socket, FileError if the state folder
    cannot be written.
    """
    path = make_state_folder() / f"device-{quote(device, safe='')}.json"
    held = LockFile.take(path)
    if held is None:
        raise _held_error(device, _holder(path))
    try:
        held.write({"device": device})
        # Lock first, then check the others: of two simultaneous programs at least one detects the other.
        for other in state_folder().glob("device-*.json"):
            if _overlap(unquote(other.stem.removeprefix("device-")), device) and held_entry(other) is not None:
                raise _held_error(device, _holder(other))
        with _computer_lock(device):
            yield
    finally:
        held.release()


_NAMES = "midair-device:"
"""Beginning of the socket names, in Linux's abstract namespace: they are no files."""


@contextmanager
def _computer_lock(device: str) -> Generator[None]:
    """While inside, no program of any user or state folder can lock the device; no effect except on Linux."""
    if sys.platform != "linux":
        yield
        return
    # A name has 107 bytes at most; a digest keeps out the same device only.
    name = quote(device, safe="") if len(device) < 30 else hashlib.sha256(device.encode()).hexdigest()
    with socket.socket(socket.AF_UNIX) as held:
        try:
            held.bind(f"\0{_NAMES}{name}")
            # Its backlog lets others connect, which gives them this process's number and user.
            held.listen(128)
        except OSError as wrong:
            if wrong.errno == errno.EADDRINUSE:
                raise _held_error(device, _socket_holder(name)) from wrong
            raise DeviceError(
                f"{device}: expected a lock for all users of this computer, got {wrong.strerror}"
            ) from wrong
        lines: list[str] = []
        with contextlib.suppress(OSError):
            lines = Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace").splitlines()
        for other in {line.partition(f" @{_NAMES}")[2] for line in lines}:
            if _overlap(device, unquote(other)):
                raise _held_error(device, _socket_holder(other))
        yield


def _socket_holder(name: str) -> str:
    import pwd

    who = "a program of another user"
    with contextlib.suppress(OSError, KeyError), socket.socket(socket.AF_UNIX) as call:
        call.settimeout(0.1)
        call.connect(f"\0{_NAMES}{name}")
        process, user, _ = struct.unpack("3i", call.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))
        who = f"process {process} of user {user}"
        who = f"process {process} of user {pwd.getpwuid(user).pw_name}"
        words = Path(f"/proc/{process}/cmdline").read_text(encoding="utf-8", errors="replace").split("\0")[:-1]
        who += f" ({''.join(each if each.isprintable() else '?' for each in shlex.join(words))[:300]})"
    return f"{who} has it"


def _overlap(one: str, other: str) -> bool:
    return one.startswith(f"{other}:") or other.startswith(f"{one}:")


def _holder(path: Path) -> str:
    entry = held_entry(path) or {}
    process, command, since = (entry.get(key, "?") for key in ("process", "command", "since"))
    return f"process {process} ({command}) has had it since {since}"


def _held_error(device: str, who: str) -> HeldError:
    return HeldError(f"{device}: expected a device that no other program uses, {who}; wait until it ends, or end it")


class StopGuard:
    """Guard of one array, reentrant; after a stop nothing sounds until the outermost block ends."""

    def __init__(self) -> None:
        # Held while sound starts, and while silencing.
        self._sound = threading.RLock()
        self._entering = threading.RLock()
        self._entered = 0
        self._stopped = threading.Event()
        self._stack = ExitStack()

    @property
    def stopped(self) -> bool:
        """True after a stop request."""
        return self._stopped.is_set()

    @contextmanager
    def held(self, name: str, device: str | None, silence: Callable[[], None]) -> Generator[None]:
        """While inside, `midair stop` reaches the array `name`, and no other program gets `device` (None: no lock).

        `silence` must be callable from any thread.
        """
        self._enter(name, device, silence)
        try:
            yield
        except KeyboardInterrupt:
            # `_interrupt` raised it to interrupt the main thread.
            if self.stopped:
                raise StoppedError(_stopped(name)) from None
            raise
        finally:
            with self._entering:
                self._entered -= 1
                if self._entered == 0:
                    try:
                        self._stack.close()
                    finally:
                        self._stopped.clear()

    @contextmanager
    def sounding(self, name: str) -> Generator[None]:
        """Inside, sound may begin and a stop waits; raises StoppedError after a stop request."""
        with self._sound:
            self.check(name)
            yield

    def check(self, name: str) -> None:
        """Raise StoppedError after a stop request."""
        if self.stopped:
            raise StoppedError(_stopped(name))

    def _enter(self, name: str, device: str | None, silence: Callable[[], None]) -> None:
        with self._entering:
            if self._entered == 0:
                main = threading.current_thread() is threading.main_thread()
                with ExitStack() as stack:
                    if device is not None:
                        stack.enter_context(device_lock(device))
                    # Only the main thread can be interrupted; others check before they play.
                    afterwards = _interrupt if main else lambda: None
                    line = open_stop_channel(name, lambda: self._stop(silence), afterwards=afterwards)
                    stack.enter_context(line)
                    self._stack = stack.pop_all()
            self._entered += 1

    def _stop(self, silence: Callable[[], None]) -> None:
        with self._sound:
            # Refuse new sound first, then silence: in the other order sound could begin in between.
            self._stopped.set()
            silence()


def _interrupt() -> None:
    """Interrupt the main thread, for example during opening; no effect if SIGINT is ignored."""
    if not callable(signal.getsignal(signal.SIGINT)):
        return
    if sys.platform == "win32":
        _thread.interrupt_main()
    else:
        # A system signal also ends a blocking wait, `interrupt_main` does not.
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _stopped(name: str) -> str:
    return f"{name}: silenced by midair stop; play again when it is safe"
