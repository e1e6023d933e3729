"""The folder in which midair keeps what outlives a program: its log, what plays now, the subject last told."""

import os
import sys
from pathlib import Path

from midair.errors import FileError


def state_folder() -> Path:
    """Where midair keeps its log and tells other terminals what plays: ``MIDAIR_STATE``, or the user's state folder.

    It need not be there yet.
    """
    if chosen := os.environ.get("MIDAIR_STATE"):
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "midair"
    return Path(os.environ.get("XDG_STATE_HOME", Path.home() / ".local" / "state")) / "midair"


def make_state_folder() -> Path:
    """The same folder, made if it was not there, for this user only.

    Raises
    ------
    FileError
        If it cannot be made.
    """
    folder = state_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as wrong:
        raise FileError(f"{folder}: {wrong.strerror}; set MIDAIR_STATE to a folder you can write to") from wrong
    return folder
