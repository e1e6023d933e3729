"""By which another terminal silences what plays, or is about to: a port on this computer, and a secret in a file."""

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

from midair.devices.safety.lock_files import LockFile, held_entry, read_lock, token
from midair.devices.safety.state_folders import make_state_folder, state_folder
from midair.errors import FileError, MidairError, StoppedError

ANSWER = b"silent\n"
WAIT = 6.0
"""How long an array may take to confirm that it is silent, in s: two orders over a link that stalls."""

FAILSAFE = 0.6
"""How long after its program has died an array may still sound, in s: the firmware's half second, and its way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopped:
    """What became of one program that played, or was about to.

    Attributes
    ----------
    process : int
        Its number; 0 where its file does not tell.
    device : str
        Name of the array that it plays on.
    outcome : {"silent", "gone", "no answer"}
        "silent": the array confirmed it, and this program plays nothing more on it. "gone": the program had ended
        without a word, and its array's failsafe has silenced it.
    command : str
        How it was started.
    reason : str
        Why there was no answer.
    """

    process: int
    device: str
    outcome: Literal["silent", "gone", "no answer"]
    command: str = ""
    reason: str = ""


@contextmanager
def open_stop_channel(
    device: str,
    silence: Callable[[], None],
    *,
    afterwards: Callable[[], None] = lambda: None,
) -> Generator[Path]:
    """While inside, `silence` is called when another terminal asks for it; gives the file that says so.

    Parameters
    ----------
    device : str
        Name of the array.
    silence : callable
        Returns when the array is silent and will stay so; raises MidairError if it is not. Called from other threads.
    afterwards : callable
        Called when the answer is given, whatever it was.

    Raises
    ------
    StoppedError
        If somebody asked for silence since this was ordered: now, or at the moment of `ordered_at`.
    FileError
        If the file cannot be made: what cannot be stopped does not play.
    """
    ordered = _ORDERED.get()
    since = uptime() if ordered is None else ordered
    secret = secrets.token_hex(16)
    held = LockFile.take(make_state_folder() / f"playing-{os.getpid()}-{token()}.json")
    if held is None:  # nobody else makes a file of this name
        raise FileError(
            f"{state_folder()}: expected a file of our own there, another program holds it; set MIDAIR_STATE"
        )
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            held.write({"device": device, "port": server.getsockname()[1], "secret": secret})
            # Written first, looked at afterwards: whoever asks for silence now finds the file, or is found here.
            if since <= last_stop() <= uptime():
                raise StoppedError(f"{device}: midair stop came while this started, nothing is played; start it again")
            listener = _Listener(server, secret, silence, afterwards)
            listener.start()
            try:
                yield held.path
            finally:
                listener.end()
    finally:
        held.let_go()


def stop_playing(*, timeout: float = WAIT) -> list[Stopped]:
    """Silence whatever plays on this computer for this user; what became of each program that said it plays.

    Programs that are starting and have not said so yet refuse to play when they come to it. All are asked at once, so
    that one that hangs keeps no other from being silent.

    Raises
    ------
    FileError
        If it could not be noted that silence was asked for, after all that play were asked.
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
    """What each living program says that plays or is about to, as its file has it."""
    entries: list[dict[str, Any]] = []
    for path in sorted(state_folder().glob("playing-*.json")):
        with contextlib.suppress(FileError):
            if (entry := held_entry(path)) is not None:
                entries.append(entry)
    return entries


def uptime() -> float:
    """Time since this computer was started, in s: the same clock in all its processes, which nobody sets."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot is None else time.clock_gettime(boot)


def process_began() -> float:
    """When this process was started, by `uptime`; where the system does not tell, when this was first asked."""
    try:
        after_name = Path("/proc/self/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
        # Field 22 of proc(5), the 20th after the name, in clock ticks; they are rounded down.
        return int(after_name[19]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return _FIRST_SEEN


_FIRST_SEEN = uptime()

_ORDERED: ContextVar[float | None] = ContextVar("ordered", default=None)


@contextmanager
def ordered_at(moment: float) -> Generator[None]:
    """Whatever plays inside was ordered at a moment of `uptime`: whoever asks for silence after it means that too."""
    before = _ORDERED.set(moment)
    try:
        yield
    finally:
        _ORDERED.reset(before)


def last_stop() -> float:
    """When silence was last asked for, by `uptime`; before all times if never since the computer was started."""
    try:
        return float(_stop_note().read_text(encoding="ascii"))
    except (OSError, ValueError):
        return -1.0


def _stop_note() -> Path:
    return state_folder() / "stopped-at"


def _note_stop() -> FileError | None:
    """Leave word for programs that are starting; what was in the way, if anything."""
    try:
        aside = make_state_folder() / f"stopped-at-{token()}"
        aside.write_text(repr(uptime()), encoding="ascii")
        aside.replace(_stop_note())
    except FileError as wrong:
        return wrong
    except OSError as wrong:
        return FileError(f"{_stop_note()}: {wrong.strerror}; a program that is just starting may not have heard of it")
    return None


class _Listener(threading.Thread):
    """Waits for calls; answers each in a thread of its own, so that one who says nothing keeps no other waiting."""

    def __init__(
        self, server: socket.socket, secret: str, silence: Callable[[], None], afterwards: Callable[[], None]
    ) -> None:
        super().__init__(name="stop line", daemon=True)
        self._server, self._secret, self._silence, self._afterwards = server, secret, silence, afterwards
        self._ended, self._calls = threading.Event(), list[threading.Thread]()

    def run(self) -> None:
        """Take calls until the end."""
        while not self._ended.is_set():
            try:
                call, _ = self._server.accept()
            except OSError:
                return
            answering = threading.Thread(target=self._answer, args=(call,), name="stop call", daemon=True)
            self._calls = [*(each for each in self._calls if each.is_alive()), answering]
            answering.start()

    def end(self) -> None:
        """Take no more calls, and let those that came be answered."""
        self._ended.set()
        # A call of our own ends the wait; close alone does not on every system.
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
    """Silence the program of a file; None if it had ended, and taken its file with it."""
    end = time.monotonic() + timeout
    try:
        # A program that has just made its file needs a moment to write into it.
        written = min(end, time.monotonic() + 1)
        while (found := read_lock(path))[0] == "held" and not _complete(found[1]) and time.monotonic() < written:
            time.sleep(0.01)
    except FileError as wrong:
        return Stopped(process=0, device=path.name, outcome="no answer", reason=str(wrong))
    state, entry = found
    if state != "held":
        return None if state == "ended" else _gone(process=0, device="unknown")
    who = {"process": _number(entry["process"]), "device": str(entry.get("device", path.name))}
    told: dict[str, Any] = {**who, "command": str(entry["command"])}
    if not _complete(entry):
        return Stopped(**told, outcome="no answer", reason=f"{path.name} does not say how to reach it")
    answer, reason = _ask(entry, end)
    if answer == ANSWER:
        return Stopped(**told, outcome="silent")
    # One that is just ending hangs up, and a moment later is no more.
    state = "held" if answer else _becomes(path, min(end, time.monotonic() + 1))
    if state == "ended":
        return None
    return _gone(**told) if state == "left" else Stopped(**told, outcome="no answer", reason=reason)


def _ask(entry: dict[str, Any], end: float) -> tuple[bytes, str]:
    """The answer of a program to the wish for silence; and in words what was wrong with it."""
    left = max(0.01, end - time.monotonic())
    try:
        with socket.create_connection(("127.0.0.1", entry["port"]), left) as call:
            call.settimeout(left)
            call.sendall(f"silence {entry['secret']}\n".encode())
            answer = call.recv(1024)
    except OSError as wrong:
        return b"", str(wrong)
    return answer, answer.decode(errors="replace").strip() or "it hung up"


def _gone(**told: Any) -> Stopped:
    """A program that ended without a word, once the failsafe of its array has surely acted."""
    time.sleep(FAILSAFE)
    return Stopped(**told, outcome="gone")


def _becomes(path: Path, end: float) -> str:
    """What becomes of a file that is held: the state that it is in at an instant, or before if nobody holds it then."""
    with contextlib.suppress(FileError):
        while (state := read_lock(path)[0]) == "held" and time.monotonic() < end:
            time.sleep(0.01)
        return state
    return "held"


def _complete(entry: dict[str, Any]) -> bool:
    port, secret = entry.get("port"), entry.get("secret")
    return isinstance(port, int) and 0 < port < 65536 and isinstance(secret, str) and secret.isalnum()


def _number(value: object) -> int:
    return value if isinstance(value, int) else 0
