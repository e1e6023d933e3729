"""What keeps playing safe whoever plays: a log of it, and a line by which another terminal silences it."""

from midair.devices.safety.play_log import log_end, log_order
from midair.devices.safety.state_folders import make_state_folder, state_folder
from midair.devices.safety.stop_lines import Stopped, stop_line, stop_playing

__all__ = [
    "Stopped",
    "log_end",
    "log_order",
    "make_state_folder",
    "state_folder",
    "stop_line",
    "stop_playing",
]
