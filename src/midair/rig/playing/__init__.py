"""Play cleared drives with a log entry, stop them on request, and re-record them."""

from .air_check import check_air as check_air
from .air_check import correct_air_of_file as correct_air_of_file
from .following import Follower as Follower
from .following import FollowRules as FollowRules
from .following import clear_followed as clear_followed
from .following import follow_as_set as follow_as_set
from .following import follow_simulated as follow_simulated
from .following import grid_of as grid_of
from .following import immediate_array as immediate_array
from .following import play_followed as play_followed
from .following import tracker_name as tracker_name
from .following import wait_until as wait_until
from .play_settings import PlaySettings as PlaySettings
from .play_settings import RigSettings as RigSettings
from .play_settings import default_exposure as default_exposure
from .rerecording import play_cleared as play_cleared
from .rerecording import rerecord as rerecord
from .solving_ahead import SolvedAhead as SolvedAhead
