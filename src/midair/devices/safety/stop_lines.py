"""By which another terminal silences what plays: a port on this computer, and a secret in a file of the user."""

import contextlib
import json
import os
import secrets
import socket
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from midair.devices.safety.state_folders import make_state_folder, state_folder

ANSWER = b"silent\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopped:
    """What became of one program that played.

    Attributes
    ----------
    process : int
        Its number.
    device : str
        Name of the array that it plays on.
    outcome : {"silent", "gone", "no answer"}
        "gone": it had ended without a word, and its array's failsafe has silenced it.
    """

    process: int
    device: str
    outcome: Literal["silent", "gone", "no answer"]


@contextmanager
def stop_line(device: str, silence: Callable[[], None]) -> Generator[Path]:
    """While inside, `silence` is called when another terminal asks for it; gives the file that says so."""
    secret = secrets.token_hex(16)
    with socket.create_server(("127.0.0.1", 0)) as server:
        path = make_state_folder() / f"playing-{os.getpid()}.json"
        entry = {"process": os.getpid(), "device": device, "port": server.getsockname()[1], "secret": secret}
        # For this user alone: whoever reads the secret can stop what plays.
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(entry, file)
        listener = threading.Thread(target=_listen, args=(server, secret, silence), name="stop line", daemon=True)
        listener.start()
        try:
            yield path
        finally:
            path.unlink(missing_ok=True)
            # A call of our own ends the wait; close alone does not on every system.
            with contextlib.suppress(OSError), socket.create_connection(server.getsockname(), 1) as end:
                end.sendall(b"end " + secret.encode() + b"\n")
            listener.join(2)


def stop_playing(*, timeout: float = 1.0) -> list[Stopped]:
    """Silence whatever plays on this computer for this user; what became of each program that said it plays."""
    return [_stop(path, timeout) for path in sorted(state_folder().glob("playing-*.json"))]


def _listen(server: socket.socket, secret: str, silence: Callable[[], None]) -> None:
    while True:
        try:
            call, _ = server.accept()
        except OSError:
            return
        with call, contextlib.suppress(OSError):
            # A caller who says nothing must not keep others from being heard.
            call.settimeout(1)
            order = call.recv(256).decode(errors="replace").split()
            if order == ["end", secret]:
                return
            if order == ["silence", secret]:
                silence()
                call.sendall(ANSWER)


def _stop(path: Path, timeout: float) -> Stopped:
    try:
        entry = json.loads(path.read_text(encoding="utf-8"))
        process, device, port, secret = (entry[key] for key in ("process", "device", "port", "secret"))
    except (OSError, ValueError, KeyError):
        path.unlink(missing_ok=True)
        return Stopped(process=0, device="unknown", outcome="gone")
    try:
        with socket.create_connection(("127.0.0.1", int(port)), timeout) as call:
            call.settimeout(timeout)
            call.sendall(f"silence {secret}\n".encode())
            silent = call.recv(64) == ANSWER
    # Nobody listens there: the program died before it could remove its file.
    except ConnectionError:
        path.unlink(missing_ok=True)
        return Stopped(process=process, device=device, outcome="gone")
    except OSError:
        silent = False
    return Stopped(process=process, device=device, outcome="silent" if silent else "no answer")
