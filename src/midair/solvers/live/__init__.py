"""One frame after another within a millisecond: the follower, its kernel, and what mirrors save."""

from midair.solvers.live.live import FrameTracker, Live
from midair.solvers.live.mirror_symmetry import symmetric_modes

__all__ = ["FrameTracker", "Live", "symmetric_modes"]
