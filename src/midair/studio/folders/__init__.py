"""The folder that the user opened, and the temporary folder of the session."""

from .one_folder import LARGEST as LARGEST
from .one_folder import PREFIX as PREFIX
from .one_folder import READABLE as READABLE
from .one_folder import StudioFolder as StudioFolder
from .one_folder import folder_of_session as folder_of_session
from .one_folder import sweep as sweep
