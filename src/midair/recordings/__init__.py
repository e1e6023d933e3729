"""Recordings: edit them, spread one channel over a patch of contact, judge their channels."""

from midair.recordings.edit import Fill, cut, gain, join, mask, resample, trim
from midair.recordings.footprint import Footprint, Path, Shape, Turn, footprint_field
from midair.recordings.quality import at_limit, dead_channels, suspicious

__all__ = [
    "at_limit",
    "Fill",
    "Footprint",
    "Path",
    "Shape",
    "Turn",
    "cut",
    "dead_channels",
    "footprint_field",
    "gain",
    "join",
    "mask",
    "resample",
    "suspicious",
    "trim",
]
