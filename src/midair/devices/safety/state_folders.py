"""The folder for midair's persistent state: the log, active playback, and the last subject."""

import os
import stat
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
