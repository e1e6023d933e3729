"""Frames longer than memory: arrays whose frames are read or computed on access, their filters and their storage."""

from .by_channel import channels as channels
from .by_channel import medians as medians
from .lazy_filters import convolve_lazily as convolve_lazily
from .lazy_filters import extend as extend
from .lazy_filters import filter_lazily as filter_lazily
from .lazy_filters import pad_with_fade as pad_with_fade
from .lazy_filters import pad_with_silence as pad_with_silence
from .lazy_filters import resample_lazily as resample_lazily
from .lazy_filters import shift_earlier as shift_earlier
from .lazy_filters import with_context as with_context
from .lazy_frames import BYTES as BYTES
from .lazy_frames import LazyFrames as LazyFrames
from .lazy_frames import Moments as Moments
from .lazy_frames import Stored as Stored
from .lazy_frames import as_lazy as as_lazy
from .lazy_frames import block_ranges as block_ranges
from .lazy_frames import blocks as blocks
from .lazy_frames import cached_blocks as cached_blocks
from .lazy_frames import concatenate_lazy as concatenate_lazy
from .lazy_frames import each_frame as each_frame
from .lazy_frames import from_iterator as from_iterator
from .lazy_frames import moments as moments
from .lazy_frames import read_frames as read_frames
from .lazy_frames import with_cache as with_cache
from .temp_frames import TempChannels as TempChannels
from .temp_frames import TempFrames as TempFrames
