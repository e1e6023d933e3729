"""Play cleared drives with a log entry, stop them on request, and re-record them."""

from midair.devices import stop_playing as stop_playing

from .air_check import AirCheck as AirCheck
from .air_check import check_air as check_air
from .air_check import correct_air_of_file as correct_air_of_file
from .air_watch import DRIFT as DRIFT
from .air_watch import watch_air as watch_air
from .play_recording import solving as solving
from .play_settings import PlaySettings as PlaySettings
from .play_settings import default_exposure as default_exposure
from .rerecording import play_cleared as play_cleared
from .rerecording import rerecord as rerecord
