"""Live: what a sensor feels now is played now."""

from midair.rig.live_touch.live_loop import LiveLoop, Pace
from midair.rig.live_touch.live_order import LiveOrder
from midair.rig.live_touch.live_take import LiveTake
from midair.rig.live_touch.playing_live import live, live_admission, speak
from midair.rig.live_touch.process import Opened, play_live
from midair.rig.live_touch.sealed import make_key
from midair.rig.live_touch.session import LiveSession, LiveStatistics
from midair.rig.live_touch.touch import Touch, TouchSettings
from midair.rig.live_touch.touch_ring import HELD, LATE, SOUNDS, RingShape, TouchRing

__all__ = [
    "HELD",
    "LATE",
    "SOUNDS",
    "LiveLoop",
    "LiveOrder",
    "LiveSession",
    "LiveStatistics",
    "LiveTake",
    "Opened",
    "Pace",
    "TouchRing",
    "RingShape",
    "Touch",
    "TouchSettings",
    "live",
    "live_admission",
    "make_key",
    "play_live",
    "speak",
]
