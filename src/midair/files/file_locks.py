"""Files and folders that one program at a time may write to."""

import os
import struct
import warnings
from contextlib import suppress
from errno import EACCES, EAGAIN, EINVAL, ENOLCK, ENOSYS, ENOTSUP, EOPNOTSUPP
from functools import cache
from pathlib import Path

from midair.errors import DeviceStateError, FileError

try:
    import fcntl
except ImportError:  # Windows, where a file that somebody writes to cannot be replaced anyway
    fcntl = None

_HELD = (EAGAIN, EACCES)
_NONE = (ENOLCK, ENOTSUP, EOPNOTSUPP, ENOSYS, EINVAL)
_PLACE = 1 << 62
"""Byte, far beyond the end of any file, that process 0 would lock: where a lock lies says whose it is."""
_FLOCK = "hhqqi"
"""struct flock of a 64-bit system: kind, whence, start, length, process."""


class NoLocksWarning(UserWarning):
    """A file system without locks, on which nobody can see that another program writes to the same file."""


def hold_open(handle: int, refusal: str) -> None:
    """Lock an open file or folder; the lock goes with the process, however it dies.

    Where there are no locks, a `NoLocksWarning` says so, and the program goes on.

    Parameters
    ----------
    handle : int
        Of the open file or folder; closing it lets go.
    refusal : str
        What to say when another program holds it.

    Raises
    ------
    DeviceStateError
        If another program does.
    FileError
        If the lock fails for another reason than that the disk has none.
    """
    if fcntl is None:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as wrong:
        if wrong.errno in _HELD:
            raise DeviceStateError(refusal) from wrong
        _warn(wrong, refusal.partition(":")[0])


def acquire_for_writing(handle: int, path: Path) -> None:
    """Tell all who ask by `check_unclaimed` that this process writes to a file, as long as it lives and has it open.

    Anybody may read the file meanwhile. Where there are no locks, a `NoLocksWarning` says so.

    Parameters
    ----------
    handle : int
        Of the file, opened for writing.
    path : Path
        What to call it in messages.
    """
    if fcntl is None:
        return
    try:
        if hasattr(fcntl, "F_OFD_SETLK"):
            place = struct.pack(_FLOCK, fcntl.F_WRLCK, os.SEEK_SET, _PLACE + os.getpid(), 1, 0)
            fcntl.fcntl(handle, fcntl.F_OFD_SETLK, place)
        else:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as wrong:
        _warn(wrong, path)


def check_unclaimed(path: Path) -> None:
    """Refuse a file to whoever would replace or remove it while another handle claims it.

    Raises
    ------
    FileError
        If one does; its message names the process.
    """
    if fcntl is None or not path.is_file():
        return
    # Who may not read a file is told so by whatever comes next.
    with suppress(PermissionError), path.open("rb") as file:
        try:
            process = _claimed_by(file.fileno())
        except OSError as wrong:
            _warn(wrong, path)
            return
        if process is not None:
            raise FileError(f"{path}: {_named(process)} is recording into it; wait until it has ended, or end it")


def _claimed_by(handle: int) -> int | None:
    """The process that claims an open file, 0 where the system does not tell which; None if nobody does."""
    if fcntl is None:
        return None
    if hasattr(fcntl, "F_OFD_GETLK"):
        everywhere = struct.pack(_FLOCK, fcntl.F_WRLCK, os.SEEK_SET, _PLACE, 0, 0)
        kind, _, start, _, _ = struct.unpack(_FLOCK, fcntl.fcntl(handle, fcntl.F_OFD_GETLK, everywhere))
        return None if kind == fcntl.F_UNLCK else max(0, start - _PLACE)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as wrong:
        if wrong.errno in _HELD:
            return 0
        raise
    return None


def _named(process: int) -> str:
    """A process in words: its number, and what was typed to start it where the system tells."""
    if process == os.getpid():
        return "this program"
    try:
        words = Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        words = []
    typed = "".join(letter if letter.isprintable() else "?" for letter in " ".join(words).strip())[:100]
    return f"process {process}{f' ({typed})' if typed else ''}" if process else "another program"


def _warn(wrong: OSError, what: Path | str) -> None:
    if wrong.errno not in _NONE:
        raise FileError(f"{what}: cannot be locked: {wrong.strerror}") from wrong
    _warn_once(f"this disk has no locks ({wrong.strerror}): see to it that no two programs write to the same file")


@cache
def _warn_once(text: str) -> None:
    # Python's own "once" begins anew whenever any library touches the filters.
    warnings.warn(text, NoLocksWarning, stacklevel=1)
