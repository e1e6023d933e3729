"""Locks for files and folders that only one program at a time may write to."""

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
except ImportError:  # Windows, where an open file cannot be replaced anyway
    fcntl = None

_HELD = (EAGAIN, EACCES)
_NONE = (ENOLCK, ENOTSUP, EOPNOTSUPP, ENOSYS, EINVAL)
_PLACE = 1 << 62
"""Byte offset, far beyond the end of any file, that process 0 would lock: the offset of a lock encodes its process."""
_FLOCK = "hhqqi"
"""struct flock of a 64-bit system: type, whence, start, length, process."""


class NoLocksWarning(UserWarning):
    """A file system without locks, on which two programs could write to the same file unnoticed."""


def lock_or_raise(handle: int, refusal: str) -> None:
    """Lock an open file or folder until the handle is closed or the process ends.

    On a file system without locks it issues a `NoLocksWarning` and continues. Raises DeviceStateError with the message
    `refusal` if another program holds the lock, and FileError if the lock fails for any other reason.
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
    """Mark an open file as being written by this process; `check_not_recording` detects the mark."""
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


def check_not_recording(path: Path) -> None:
    """Raise FileError, which names the process, if another handle is writing to a file to be replaced or removed."""
    if fcntl is None or not path.is_file():
        return
    # Without read permission, the following operation raises the error.
    with suppress(PermissionError), path.open("rb") as file:
        try:
            process = _writer_of(file.fileno())
        except OSError as wrong:
            _warn(wrong, path)
            return
        if process is not None:
            raise FileError(f"{path}: {_program(process)} is recording into it; wait until it has ended, or end it")


def _writer_of(handle: int) -> int | None:
    """Process that is writing to an open file, 0 if the system does not report which one, or None."""
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


def _program(process: int) -> str:
    """Process number and, where the system reports it, its command line."""
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
    _warn_once(f"this disk has no locks ({wrong.strerror}): make sure that no two programs write to the same file")


@cache
def _warn_once(text: str) -> None:
    # Python's own "once" starts again whenever a library changes the warning filters.
    warnings.warn(text, NoLocksWarning, stacklevel=1)
