"""Play cleared drives with a log entry, stop them on request, and re-record them."""

from midair.devices import stop_playing
from midair.rig.playing.air_check import AirCheck, check_air
from midair.rig.playing.cleared_play import play_cleared
from midair.rig.playing.rerecording import default_exposure, rerecord

__all__ = [
    "AirCheck",
    "play_cleared",
    "rerecord",
    "check_air",
    "stop_playing",
    "default_exposure",
]
