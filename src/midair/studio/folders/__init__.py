"""The folder that the user opened, and the temporary folder of the session."""

from midair.studio.folders.one_folder import LARGEST, READABLE, StudioFolder
from midair.studio.folders.session_folder import PREFIX, folder_of_session, sweep

__all__ = ["LARGEST", "PREFIX", "READABLE", "StudioFolder", "folder_of_session", "sweep"]
