"""One frame after another within a millisecond: the follower, its kernel, and what mirrors save."""

from midair.solvers.live.folded import folded_modes
from midair.solvers.live.live import Follower, Live

__all__ = ["Follower", "Live", "folded_modes"]
