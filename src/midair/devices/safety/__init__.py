"""Safety: one program per device, a log, a channel through which another terminal stops playback, a guard process."""

from .lock_files import append_line as append_line
from .lock_files import make_state_folder as make_state_folder
from .lock_files import state_folder as state_folder
from .play_log import Ending as Ending
from .play_log import close_orders as close_orders
from .play_log import exposed as exposed
from .play_log import hours_error as hours_error
from .play_log import log_end as log_end
from .play_log import log_order as log_order
from .play_log import log_pause as log_pause
from .play_log import read_log as read_log
from .play_log import sound_left as sound_left
from .stop_channel import Stopped as Stopped
from .stop_channel import ordered_at as ordered_at
from .stop_channel import playing_now as playing_now
from .stop_channel import process_start_time as process_start_time
from .stop_channel import stop_playing as stop_playing
from .stop_channel import uptime as uptime
from .stop_guard import StopGuard as StopGuard
from .stop_guard import device_lock as device_lock
from .stop_guard import open_stop_input as open_stop_input
from .stop_guard import stop_on_input as stop_on_input
