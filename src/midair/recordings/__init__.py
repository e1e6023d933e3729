"""Edit recordings, fill gaps, check channels, and turn one channel into a pressure field on the sensor."""

from midair.recordings.edit import Fill, cut, gain, join, mask, resample, trim
from midair.recordings.footprint import Footprint, Path, Shape, Turn, footprint_field
from midair.recordings.mending import GapFill, Mended, Mending, mend
from midair.recordings.quality import at_limit, dead_channels, suspicious

__all__ = [
    "at_limit",
    "Fill",
    "Footprint",
    "GapFill",
    "Mended",
    "Mending",
    "Path",
    "Shape",
    "Turn",
    "cut",
    "dead_channels",
    "footprint_field",
    "gain",
    "join",
    "mask",
    "mend",
    "resample",
    "suspicious",
    "trim",
]
