"""The channel through which another terminal stops playback: a local port, and a secret in a lock file."""

import contextlib
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from midair.devices.safety.lock_files import LockFile, held_entry, make_state_folder, read_lock, state_folder, token
from midair.errors import FileError, MidairError, StoppedError

ANSWER = b"silent\n"
WAIT = 6.0
"""Maximum time for an array to confirm silence, in s: two commands over a slow connection."""

FAILSAFE = 0.6
"""Maximum time that an array sounds after its program died, in s: the firmware's timeout of 0.5 s, and transmission."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopped:
    """Result of stopping one program that played, or was about to."""

    process: int
    """Process number; 0 if unknown."""
    device: str
    """Name of the array."""
    outcome: Literal["silent", "gone", "no answer"]
    """"silent": the array confirmed silence, and the program plays nothing more on it. "gone": the program had died,
    and the failsafe of its array has silenced it."""
    command: str = ""
    """Command line of the program."""
    reason: str = ""
    """Reason for "no answer"."""


@contextmanager
def open_stop_channel(
    device: str, silence: Callable[[], None], *, afterwards: Callable[[], None] = lambda: None
) -> Generator[Path]:
    """While inside, a stop request of another terminal calls `silence`; yields the path of the lock file.

    `silence` runs in other threads, returns once the array stays silent and raises MidairError if it does not;
    `afterwards` is called after every answer. Raises StoppedError if a stop was requested since now, or since the time
    of `ordered_at`; FileError if the file cannot be created, since playback must be stoppable.
    """
    ordered = _ORDERED.get()
    since = uptime() if ordered is None else ordered
    secret = secrets.token_hex(16)
    held = LockFile.take(make_state_folder() / f"playing-{os.getpid()}-{token()}.json")
    if held is None:  # the name contains this process's number and a random token
        raise FileError(
            f"{state_folder()}: expected a new lock file there, got one that another program holds; set MIDAIR_STATE"
        )
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            held.write({"device": device, "port": server.getsockname()[1], "secret": secret})
            # Write first, check afterwards: a simultaneous stop either finds the file or is found here.
            if since <= last_stop() <= uptime():
                raise StoppedError(
                    f"{device}: midair stop was called during the start, nothing is played; start it again"
                )
            listener = _Listener(server, secret, silence, afterwards)
            listener.start()
            try:
                yield held.path
            finally:
                listener.end()
    finally:
        held.release()


def stop_playing(*, timeout: float = WAIT) -> list[Stopped]:
    """Silence everything that plays on this computer for this user; return the result for each program.

    Programs that are just starting will refuse to play. All programs are contacted at once, so that one that hangs does
    not delay the others.

    Raises FileError if the request could not be recorded for starting programs; the others were contacted before.
    """
    problem = _note_stop()
    paths = sorted(state_folder().glob("playing-*.json"))
    with ThreadPoolExecutor(min(64, len(paths) or 1)) as pool:
        asked = [pool.submit(_stop, path, timeout) for path in paths]
    stopped = [one for each in asked if (one := each.result()) is not None]
    if problem is not None and not stopped:
        raise problem
    return stopped


def playing_now() -> list[dict[str, Any]]:
    """Entries of all live programs that play or are about to play."""
    entries: list[dict[str, Any]] = []
    for path in sorted(state_folder().glob("playing-*.json")):
        with contextlib.suppress(FileError):
            if (entry := held_entry(path)) is not None:
                entries.append(entry)
    return entries


def uptime() -> float:
    """Time since this computer started, in s: one clock for all processes, which is never adjusted."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot is None else time.clock_gettime(boot)


def process_start_time() -> float:
    """Start time of this process on the clock of `uptime`; the import time of this module if the system does not
    provide it.
    """
    try:
        after_name = Path("/proc/self/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
        # Field 22 of proc(5), the 20th after the name, in clock ticks, rounded down.
        return int(after_name[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return _FIRST_SEEN


_FIRST_SEEN = uptime()

_ORDERED: ContextVar[float | None] = ContextVar("ordered", default=None)


@contextmanager
def ordered_at(moment: float) -> Generator[None]:
    """Date playback inside the block to a moment of `uptime`; a later stop request prevents it."""
    before = _ORDERED.set(moment)
    try:
        yield
    finally:
        _ORDERED.reset(before)


def last_stop() -> float:
    """Time of the last stop request, on the clock of `uptime`; -1 if there was none since the computer started."""
    try:
        return float(_stop_note().read_text(encoding="ascii"))
    except (OSError, ValueError):
        return -1.0


def _stop_note() -> Path:
    return state_folder() / "stopped-at"


def _note_stop() -> FileError | None:
    """Record the request for programs that are starting; return the error, if any."""
    try:
        aside = make_state_folder() / f"stopped-at-{token()}"
        aside.write_text(repr(uptime()), encoding="ascii")
        aside.replace(_stop_note())
    except FileError as wrong:
        return wrong
    except OSError as wrong:
        return FileError(f"{_stop_note()}: {wrong.strerror}; a program that is just starting may not stop")
    return None


class _Listener(threading.Thread):
    """Accepts calls and answers each in its own thread, so that a silent caller does not block others."""

    def __init__(
        self, server: socket.socket, secret: str, silence: Callable[[], None], afterwards: Callable[[], None]
    ) -> None:
        super().__init__(name="stop line", daemon=True)
        self._server, self._secret, self._silence, self._afterwards = server, secret, silence, afterwards
        self._ended, self._calls = threading.Event(), list[threading.Thread]()

    def run(self) -> None:
        """Accept calls until the end."""
        while not self._ended.is_set():
            try:
                call, _ = self._server.accept()
            except OSError:
                return
            thread = threading.Thread(target=self._answer, args=(call,), name="stop call", daemon=True)
            self._calls = [*(each for each in self._calls if each.is_alive()), thread]
            thread.start()

    def end(self) -> None:
        """Accept no more calls, and finish the open ones."""
        self._ended.set()
        # A connection from here ends accept(); on some systems close() does not.
        with contextlib.suppress(OSError):
            socket.create_connection(self._server.getsockname(), 1).close()
        self.join(2)
        for call in self._calls:
            call.join(WAIT)

    def _answer(self, call: socket.socket) -> None:
        with call, contextlib.suppress(OSError):
            call.settimeout(1)
            if call.recv(256).decode(errors="replace").split() != ["silence", self._secret]:
                return
            try:
                self._silence()
            except MidairError as wrong:
                answer = f"failed: {wrong}\n".encode()[:1000]
            else:
                answer = ANSWER
            try:
                call.sendall(answer)
            finally:
                self._afterwards()


def _stop(path: Path, timeout: float) -> Stopped | None:
    """Silence the program of a lock file; None if it had ended and removed the file."""
    end = time.monotonic() + timeout
    try:
        # A program that has just created its file needs a moment to write it.
        written = min(end, time.monotonic() + 1)
        while (found := read_lock(path))[0] == "held" and not _complete(found[1]) and time.monotonic() < written:
            time.sleep(0.01)
    except FileError as wrong:
        return Stopped(process=0, device=path.name, outcome="no answer", reason=str(wrong))
    state, entry = found
    if state != "held":
        return None if state == "ended" else _dead_program(process=0, device="unknown")
    process = entry["process"] if isinstance(entry["process"], int) else 0
    fields: dict[str, Any] = {"process": process, "device": str(entry.get("device", path.name))}
    fields["command"] = str(entry["command"])
    if not _complete(entry):
        return Stopped(**fields, outcome="no answer", reason=f"{path.name} holds no port and secret")
    answer, reason = _request_silence(entry, end)
    if answer == ANSWER:
        return Stopped(**fields, outcome="silent")
    # A program that is just ending closes the connection and soon removes its file.
    state = "held" if answer else _state_by(path, min(end, time.monotonic() + 1))
    if state == "ended":
        return None
    return _dead_program(**fields) if state == "left" else Stopped(**fields, outcome="no answer", reason=reason)


def _request_silence(entry: dict[str, Any], end: float) -> tuple[bytes, str]:
    """Answer of a program to a stop request, and the reason if it failed."""
    left = max(0.01, end - time.monotonic())
    try:
        with socket.create_connection(("127.0.0.1", entry["port"]), left) as call:
            call.settimeout(left)
            call.sendall(f"silence {entry['secret']}\n".encode())
            answer = call.recv(1024)
    except OSError as wrong:
        return b"", str(wrong)
    return answer, answer.decode(errors="replace").strip() or "the program closed the connection"


def _dead_program(**fields: Any) -> Stopped:
    """Result for a program that died; waits until the failsafe of its array has acted."""
    time.sleep(FAILSAFE)
    return Stopped(**fields, outcome="gone")


def _state_by(path: Path, end: float) -> str:
    """State of a held file at the time `end`, or earlier if it is released."""
    with contextlib.suppress(FileError):
        while (state := read_lock(path)[0]) == "held" and time.monotonic() < end:
            time.sleep(0.01)
        return state
    return "held"


def _complete(entry: dict[str, Any]) -> bool:
    port, secret = entry.get("port"), entry.get("secret")
    return isinstance(port, int) and 0 < port < 65536 and isinstance(secret, str) and secret.isalnum()
