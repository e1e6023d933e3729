"""Play: admitted drives, logged, stopped on demand, and re-recorded."""

from midair.rig.playing.admitted import play_admitted
from midair.rig.playing.rerecording import Gate, rerecord
from midair.rig.playing.stop_line import stop_playing

__all__ = [
    "Gate",
    "play_admitted",
    "rerecord",
    "stop_playing",
]
