"""Live touch: the signal of a sensor is played on an array while it is measured."""

from .live_loop import LiveLoop as LiveLoop
from .live_loop import Pace as Pace
from .live_settings import LiveMapping as LiveMapping
from .live_settings import LiveSettings as LiveSettings
from .playing_live import live as live
from .playing_live import live_clearance as live_clearance
from .process import LoopStarted as LoopStarted
from .process import streamed as streamed
from .session import LiveSession as LiveSession
from .session import LiveStatistics as LiveStatistics
from .session import LiveTake as LiveTake
from .timing import SensorRate as SensorRate
from .timing import request_realtime as request_realtime
from .touch import Touch as Touch
from .touch_ring import FRAME_EMITTED as FRAME_EMITTED
from .touch_ring import FRAME_LATE as FRAME_LATE
from .touch_ring import FRAME_REPEATED as FRAME_REPEATED
from .touch_ring import RingShape as RingShape
from .touch_ring import TouchRing as TouchRing
