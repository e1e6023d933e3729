"""Play: admitted drives, logged, stopped on demand, and re-recorded."""

from midair.rig.playing.admitted import play_admitted
from midair.rig.playing.rerecording import rerecord, usual_exposure
from midair.rig.playing.stop_line import stop_playing

__all__ = [
    "play_admitted",
    "rerecord",
    "stop_playing",
    "usual_exposure",
]
