"""Play: admitted drives, logged, stopped on demand, and re-recorded."""

from midair.devices import stop_playing
from midair.rig.playing.admitted import play_admitted
from midair.rig.playing.rerecording import rerecord, usual_exposure

__all__ = [
    "play_admitted",
    "rerecord",
    "stop_playing",
    "usual_exposure",
]
