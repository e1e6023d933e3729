"""Recordings: edit them, spread one channel over a patch of contact, judge their channels."""

from midair.recordings.edit import Fill, cut, gain, join, mask, resample, trim
from midair.recordings.footprint import Footprint, Path, Shape, Turn, footprint_field
from midair.recordings.quality import at_limit, clipped_share, dead_channels, suspicious

__all__ = [
    "at_limit",
    "Fill",
    "Footprint",
    "Path",
    "Shape",
    "Turn",
    "clipped_share",
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
