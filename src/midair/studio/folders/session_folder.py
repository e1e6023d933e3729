"""Temporary folder of one session, removed when the studio ends or, after a crash, at the next start."""

import os
import shutil
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from midair.errors import DeviceStateError
from midair.files import lock_or_raise

PREFIX = "midair-studio-"
_HELD = "held"
"""File that the studio locks; the operating system releases the lock when the process ends."""

_YOUNG = 60.0
"""Seconds for which a folder without that file may belong to a studio that is starting."""


@contextmanager
def folder_of_session(where: Path | None = None) -> Generator[Path]:
    """Make a folder in `where` (by default the system's temporary folder); remove those of dead studios."""
    place = where or Path(tempfile.gettempdir())
    sweep(place)
    with tempfile.TemporaryDirectory(prefix=PREFIX, dir=place, ignore_cleanup_errors=True) as name:
        made, folder = Path(name) / f".{_HELD}", Path(name)
        handle = os.open(made, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            lock_or_raise(handle, f"{folder}: expected to lock it")
            # The file gets its name after it is locked, so that no other process finds it unlocked.
            made.rename(folder / _HELD)
            yield folder
        finally:
            os.close(handle)


def sweep(place: Path) -> list[Path]:
    """Remove the folders of dead studios of this user; returns those removed."""
    gone: list[Path] = []
    for folder in place.glob(f"{PREFIX}*"):
        # Another process may own this folder or be removing it too.
        with suppress(OSError, DeviceStateError):
            if not folder.is_symlink() and folder.is_dir() and _ours(folder) and _left(folder):
                shutil.rmtree(folder)
                gone.append(folder)
    return gone


def _ours(folder: Path) -> bool:
    return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()


def _left(folder: Path) -> bool:
    """True if no process holds the lock; DeviceStateError or OSError otherwise."""
    held = folder / _HELD
    if not held.exists():
        return time.time_ns() / 1e9 - folder.stat().st_mtime > _YOUNG  # noqa: TID251  # compared with a file's time
    handle = os.open(held, os.O_RDWR)
    try:
        lock_or_raise(handle, f"{folder}: in use by a studio")
    finally:
        os.close(handle)
    # Without such locks, as on Windows, an open file cannot be removed.
    held.unlink()
    return True
