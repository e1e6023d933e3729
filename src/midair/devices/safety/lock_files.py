"""Small files that a living process holds: what one says is true while its lock is there, which dies with it."""

import contextlib
import getpass
import json
import os
import secrets
import shlex
import stat
import sys
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from midair.errors import FileError

_AT_ONCE = getattr(os, "O_NONBLOCK", 0)
"""Opens without a wait: a pipe in a file's place must not hang."""

LONGEST = 65536
"""Bytes that are read of such a file: an entry has some hundred."""

NAMELESS = {"process": 0, "command": "an unknown command", "since": "an unknown time"}
"""What is said of a holder whose file cannot be understood."""


class LockFile:
    """A file that this process holds, of this user alone; leaving it lets go and removes it.

    Made by `take` only.
    """

    def __init__(self, path: Path, handle: int) -> None:
        self.path, self._handle = path, handle

    @classmethod
    def take(cls, path: Path) -> "LockFile | None":
        """Hold a file, made if it was not there; None where another holds it.

        Raises
        ------
        FileError
            If it cannot be made, or its file system has no locks.
        """
        while True:
            try:
                handle = os.open(path, os.O_RDWR | os.O_CREAT | _AT_ONCE, 0o600)
                try:
                    if not stat.S_ISREG(os.fstat(handle).st_mode):
                        raise FileError(f"{path}: expected a file, got something else; remove it, or set MIDAIR_STATE")
                    locked = _lock(handle)
                except BaseException:
                    os.close(handle)
                    raise
            except OSError as wrong:
                reason = wrong.strerror or str(wrong)
                raise FileError(
                    f"{path}: {reason}; set MIDAIR_STATE to a folder on this computer to write to"
                ) from wrong
            if not locked:
                os.close(handle)
                return None
            if _same(handle, path):
                return cls(path, handle)
            # Whoever had it before removed it between the opening and the lock.
            os.close(handle)

    def write(self, entry: dict[str, object]) -> None:
        """Make this its content, with who holds it since when."""
        content = json.dumps(entry | holder()).encode()
        try:
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, content)
        except OSError as wrong:
            raise FileError(f"{self.path}: {wrong.strerror}; set MIDAIR_STATE to a folder with room") from wrong

    def let_go(self) -> None:
        """Remove it and release the lock."""
        handle, self._handle = self._handle, -1
        if handle >= 0:
            # Removed while it is locked, so that nobody finds it free and half gone.
            with contextlib.suppress(OSError):
                self.path.unlink()
            os.close(handle)


def holder() -> dict[str, object]:
    """Who this process is: number, command, since when, and whose."""
    return {
        "process": os.getpid(),
        "command": command(),
        "since": datetime.now().astimezone().isoformat(timespec="seconds"),
        "user": user(),
    }


def command() -> str:
    """What was typed to start this process, in printable characters."""
    name = Path(sys.argv[0])
    shown = name.parent.name if name.name == "__main__.py" else name.name
    typed = shlex.join([shown or "python", *sys.argv[1:]])
    return "".join(each if each.isprintable() else "?" for each in typed)[:300]


def user() -> str:
    """Name of the user; empty where nobody knows."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):
        return ""


def held_entry(path: Path) -> dict[str, Any] | None:
    """What the living holder of a file says in it, as far as it can be understood; None where nobody holds it.

    Raises
    ------
    FileError
        As `read_lock`.
    """
    state, entry = read_lock(path)
    return entry if state == "held" else None


def read_lock(path: Path) -> tuple[Literal["held", "left", "ended"], dict[str, Any]]:
    """Whether a file is held, was left behind by a process that died, or is no longer there; and what it says.

    One that was left behind is removed. A folder or a pipe of that name is no such file, and stays.

    Raises
    ------
    FileError
        If it cannot be opened, or its file system has no locks, so that nobody can tell.
    """
    try:
        handle = os.open(path, os.O_RDWR | _AT_ONCE)
    except (FileNotFoundError, IsADirectoryError):
        return "ended", {}
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}") from wrong
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return "ended", {}
        # Where there are no locks, whoever answers is alive.
        if sys.platform != "win32" and _lock(handle):
            if not _same(handle, path):
                return "ended", {}
            path.unlink()
            return "left", {}
        return "held", NAMELESS | _understood(os.read(handle, LONGEST))
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}") from wrong
    finally:
        os.close(handle)


def token() -> str:
    """A word that no other process has."""
    return secrets.token_hex(4)


def _understood(content: bytes) -> dict[str, Any]:
    try:
        entry = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _lock(handle: int) -> bool:
    """Lock an open file unless another has it; always done where the system has no such locks."""
    if sys.platform == "win32":
        return True
    from fcntl import LOCK_EX, LOCK_NB, flock

    try:
        flock(handle, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _same(handle: int, path: Path) -> bool:
    """Whether a path still leads to an open file."""
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False
