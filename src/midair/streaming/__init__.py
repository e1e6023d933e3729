"""Frames longer than memory: arrays whose frames are read or computed on access, and their temporary storage."""

from .lazy_frames import BYTES as BYTES
from .lazy_frames import LazyFrames as LazyFrames
from .lazy_frames import Stored as Stored
from .lazy_frames import block_ranges as block_ranges
from .lazy_frames import blocks as blocks
from .lazy_frames import cached_blocks as cached_blocks
from .lazy_frames import concatenate_lazy as concatenate_lazy
from .lazy_frames import each_frame as each_frame
from .lazy_frames import read_frames as read_frames
from .temp_frames import ArrivingFrames as ArrivingFrames
from .temp_frames import TempFrames as TempFrames
