"""Solve one frame after another within a millisecond: solver, Numba kernel, and mirror symmetry."""

from .live import FrameTracker as FrameTracker
from .live import Live as Live
