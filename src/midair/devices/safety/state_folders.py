"""The folder for midair's persistent state: the log, active playback, and the last subject."""

import os
import sys
from pathlib import Path

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

    Raises
    ------
    FileError
        If it cannot be created.
    """
    folder = state_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as wrong:
        raise FileError(f"{folder}: {wrong.strerror}; set MIDAIR_STATE to a folder you can write to") from wrong
    return folder
