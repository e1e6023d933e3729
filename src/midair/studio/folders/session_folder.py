"""The folder of one session, gone when the studio ends; what a killed one left goes at the next start."""

import os
import shutil
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from midair.errors import DeviceStateError
from midair.files import hold_open

PREFIX = "midair-studio-"
_HELD = "held"
"""A file in the folder that its studio holds: the lock goes with the process, however it dies."""

_YOUNG = 60.0
"""Seconds for which a folder without that file may belong to a studio that is just starting."""


@contextmanager
def folder_of_session(where: Path | None = None) -> Generator[Path]:
    """A new folder, removed at the end; what dead studios left is removed now.

    Parameters
    ----------
    where : Path, optional
        In which to make it; the system's place for such things if None.
    """
    place = where or Path(tempfile.gettempdir())
    sweep(place)
    with tempfile.TemporaryDirectory(prefix=PREFIX, dir=place, ignore_cleanup_errors=True) as name:
        made, folder = Path(name) / f".{_HELD}", Path(name)
        handle = os.open(made, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            hold_open(handle, f"{folder}: expected it to be ours")
            # It has its name only when it is held, so that nobody finds it free before.
            made.rename(folder / _HELD)
            yield folder
        finally:
            os.close(handle)


def sweep(place: Path) -> list[Path]:
    """Remove the folders of studios that are dead; which they were. Those of other people are left alone."""
    gone: list[Path] = []
    for folder in place.glob(f"{PREFIX}*"):
        # Somebody else may be sweeping too, or be the one whose folder it is.
        with suppress(OSError, DeviceStateError):
            if not folder.is_symlink() and folder.is_dir() and _ours(folder) and _left(folder):
                shutil.rmtree(folder)
                gone.append(folder)
    return gone


def _ours(folder: Path) -> bool:
    return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()


def _left(folder: Path) -> bool:
    """Whether nobody holds it; DeviceStateError or OSError where somebody does."""
    held = folder / _HELD
    if not held.exists():
        return time.time_ns() / 1e9 - folder.stat().st_mtime > _YOUNG  # noqa: TID251  # compared with a file's time
    handle = os.open(held, os.O_RDWR)
    try:
        hold_open(handle, f"{folder}: a studio has it")
    finally:
        os.close(handle)
    # Where there are no such locks, as on Windows, a file that is open cannot be removed.
    held.unlink()
    return True
