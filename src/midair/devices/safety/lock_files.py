"""The state folder, and lock files in it: an entry is valid while the process that wrote it holds the lock."""

import contextlib
import errno
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


def state_folder() -> Path:
    """Folder of the log and of active playback: ``MIDAIR_STATE``, or the user's state folder; it may not exist yet."""
    if chosen := os.environ.get("MIDAIR_STATE"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "midair"
    return Path(os.environ.get("XDG_STATE_HOME", Path.home() / ".local" / "state")) / "midair"


def make_state_folder() -> Path:
    """Create the state folder, private to this user, if it does not exist.

    Raises FileError if it cannot be created, belongs to another user, or can be written by other users.
    """
    folder = state_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as wrong:
        raise FileError(f"{folder}: {wrong.strerror}; set MIDAIR_STATE to a folder you can write to") from wrong
    if sys.platform != "win32":
        found = folder.stat()
        # Other users could otherwise replace the log or the locks.
        if found.st_uid != os.geteuid():
            raise FileError(
                f"{folder}: expected a state folder of this user (number {os.geteuid()}), got one of user "
                f"{found.st_uid}; set MIDAIR_STATE to a folder of your own"
            )
        if found.st_mode & 0o022:
            raise FileError(
                f"{folder}: expected a state folder that only you can write to, got mode "
                f"{stat.S_IMODE(found.st_mode):o}; run chmod go-w {folder}, or set MIDAIR_STATE to a folder of your own"
            )
    return folder


_NO_WAIT = getattr(os, "O_NONBLOCK", 0)
"""Open without waiting, so that a pipe in place of a file does not block."""

_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
"""Open no symbolic link, which would overwrite the file that it refers to."""

ENTRY_MAX = 65536
"""Maximum number of bytes read from a lock file; an entry has some hundred."""

UNKNOWN_HOLDER = {"process": 0, "command": "an unknown command", "since": "an unknown time"}
"""Entry for a holder whose file cannot be parsed."""


class LockFile:
    """A file locked by this process, private to this user; `release` removes it. Created by `take` only."""

    def __init__(self, path: Path, handle: int) -> None:
        self.path, self._handle = path, handle

    @classmethod
    def take(cls, path: Path) -> "LockFile | None":
        """Create and lock a file; None if another process holds it, FileError if that cannot be determined."""
        while True:
            try:
                handle = open_no_link(path, os.O_RDWR | os.O_CREAT)
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
            if _is_same_file(handle, path):
                return cls(path, handle)
            # The previous holder removed it between our opening and locking it.
            os.close(handle)

    def write(self, entry: dict[str, object]) -> None:
        """Write an entry, with the process that holds the file and the time."""
        content = json.dumps(entry | holder()).encode()
        try:
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, content)
        except OSError as wrong:
            raise FileError(f"{self.path}: {wrong.strerror}; set MIDAIR_STATE to a folder with free space") from wrong

    def release(self) -> None:
        """Remove the file and release the lock."""
        handle, self._handle = self._handle, -1
        if handle >= 0:
            # Removed while locked, so that no other process can lock a deleted file.
            with contextlib.suppress(OSError):
                self.path.unlink()
            os.close(handle)


def open_no_link(path: Path, flags: int) -> int:
    """Open a file without waiting, private to this user if it is created; OSError for a symbolic link."""
    try:
        return os.open(path, flags | _NO_WAIT | _NO_LINK, 0o600)
    except OSError as wrong:
        if wrong.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "expected a file, got a symbolic link; remove it") from wrong
        raise


def append_line(path: Path, line: bytes) -> None:
    """Append one whole line and sync, or nothing, readable for this user only; raises OSError."""
    handle = open_no_link(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    try:
        # A single write, so that lines of two programs do not mix; on a full disk it stores a part and raises no error.
        if (taken := os.write(handle, line)) < len(line):
            os.ftruncate(handle, os.lseek(handle, 0, os.SEEK_CUR) - taken)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.fsync(handle)
    finally:
        os.close(handle)


def holder() -> dict[str, object]:
    """Number, command, start time and user of this process."""
    return {
        "process": os.getpid(),
        "command": command(),
        "since": datetime.now().astimezone().isoformat(timespec="seconds"),
        "user": user(),
    }


def command() -> str:
    """The command line of this process, in printable characters."""
    name = Path(sys.argv[0])
    shown = name.parent.name if name.name == "__main__.py" else name.name
    typed = shlex.join([shown or "python", *sys.argv[1:]])
    return "".join(each if each.isprintable() else "?" for each in typed)[:300]


def user() -> str:
    """Name of the user; empty if unknown."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):
        return ""


def held_entry(path: Path) -> dict[str, Any] | None:
    """Entry of a file that a process holds; None if no process holds it."""
    state, entry = read_lock(path)
    return entry if state == "held" else None


def read_lock(path: Path) -> tuple[Literal["held", "left", "ended"], dict[str, Any]]:
    """State of a lock file (held, left by a process that died, or removed) and its entry.

    A file left behind is removed; a folder, pipe or link of that name is not. Raises FileError if the file cannot be
    opened or locked.
    """
    try:
        handle = open_no_link(path, os.O_RDWR)
    except (FileNotFoundError, IsADirectoryError):
        return "ended", {}
    except OSError as wrong:
        if wrong.errno == errno.ELOOP:
            return "ended", {}
        raise FileError(f"{path}: {wrong.strerror}") from wrong
    try:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return "ended", {}
        # Without locks the state is unknown; a process that answers is alive.
        if sys.platform != "win32" and _lock(handle):
            if not _is_same_file(handle, path):
                return "ended", {}
            path.unlink()
            return "left", {}
        return "held", UNKNOWN_HOLDER | _parse(os.read(handle, ENTRY_MAX))
    except OSError as wrong:
        raise FileError(f"{path}: {wrong.strerror}") from wrong
    finally:
        os.close(handle)


def token() -> str:
    """A random word, unique among processes."""
    return secrets.token_hex(4)


def _parse(content: bytes) -> dict[str, Any]:
    try:
        entry = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _lock(handle: int) -> bool:
    """Lock an open file; False if another process holds it, always True on a system without such locks."""
    if sys.platform == "win32":
        return True
    from fcntl import LOCK_EX, LOCK_NB, flock

    try:
        flock(handle, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_same_file(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False
