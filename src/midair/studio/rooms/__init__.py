"""The rooms of the studio, a file each: what a page can order there, and what it is told."""

from midair.studio.rooms.compare_room import CompareRoom
from midair.studio.rooms.playing_room import PlayingRoom
from midair.studio.rooms.record_room import RecordRoom
from midair.studio.rooms.reproduce_room import HowMade, ReproduceRoom

__all__ = ["CompareRoom", "HowMade", "PlayingRoom", "RecordRoom", "ReproduceRoom"]
