"""Live touch: the signal of a sensor is played on an array while it is measured."""

from midair.rig.live_touch.encryption import make_key
from midair.rig.live_touch.live_loop import LiveLoop, Pace
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.live_take import LiveTake
from midair.rig.live_touch.playing_live import live, live_clearance, send_touch
from midair.rig.live_touch.process import LoopStarted, play_live
from midair.rig.live_touch.session import LiveSession, LiveStatistics
from midair.rig.live_touch.touch import Touch, TouchSettings
from midair.rig.live_touch.touch_ring import FRAME_EMITTED, FRAME_LATE, FRAME_REPEATED, RingShape, TouchRing

__all__ = [
    "FRAME_REPEATED",
    "FRAME_LATE",
    "FRAME_EMITTED",
    "LiveLoop",
    "LiveSettings",
    "LiveSession",
    "LiveStatistics",
    "LiveTake",
    "LoopStarted",
    "Pace",
    "TouchRing",
    "RingShape",
    "Touch",
    "TouchSettings",
    "live",
    "live_clearance",
    "make_key",
    "play_live",
    "send_touch",
]
