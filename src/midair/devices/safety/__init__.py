"""Safety of playback: one program per device, a log, and a channel through which another terminal stops it."""

from midair.devices.safety.device_locks import device_lock
from midair.devices.safety.play_log import Ending, log_end, log_order
from midair.devices.safety.state_folders import make_state_folder, state_folder
from midair.devices.safety.stop_channel import (
    Stopped,
    ordered_at,
    playing_now,
    process_start_time,
    stop_playing,
    uptime,
)
from midair.devices.safety.stop_guard import StopGuard

__all__ = [
    "Ending",
    "StopGuard",
    "Stopped",
    "device_lock",
    "log_end",
    "log_order",
    "make_state_folder",
    "ordered_at",
    "playing_now",
    "process_start_time",
    "state_folder",
    "stop_playing",
    "uptime",
]
