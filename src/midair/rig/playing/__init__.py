"""Play cleared drives with a log entry, stop them on request, and re-record them."""

from midair.devices import stop_playing
from midair.rig.playing.air_check import RoomAir, room_air
from midair.rig.playing.cleared_play import play_cleared
from midair.rig.playing.rerecording import rerecord, usual_exposure

__all__ = [
    "RoomAir",
    "play_cleared",
    "rerecord",
    "room_air",
    "stop_playing",
    "usual_exposure",
]
