"""Solve one frame after another within a millisecond: solver, Numba kernel, and mirror symmetry."""

from midair.solvers.live.live import FrameTracker, Live
from midair.solvers.live.mirror_symmetry import symmetric_modes

__all__ = ["FrameTracker", "Live", "symmetric_modes"]
