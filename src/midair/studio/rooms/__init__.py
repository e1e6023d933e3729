"""The rooms of the studio, a file each: what a page can order there, and what it is told."""

from midair.studio.rooms.calibrate_room import CalibrateRoom
from midair.studio.rooms.compare_room import CompareRoom
from midair.studio.rooms.live_room import LiveRoom
from midair.studio.rooms.playing_room import PlayingRoom
from midair.studio.rooms.record_room import RecordRoom
from midair.studio.rooms.reproduce_room import HowMade, ReproduceRoom
from midair.studio.rooms.study_room import StudyRoom

__all__ = [
    "CalibrateRoom",
    "CompareRoom",
    "HowMade",
    "LiveRoom",
    "PlayingRoom",
    "RecordRoom",
    "ReproduceRoom",
    "StudyRoom",
]
