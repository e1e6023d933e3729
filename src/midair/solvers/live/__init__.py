"""One frame after another within a millisecond: the follower, its kernel."""

from midair.solvers.live.live import Follower, Live

__all__ = ["Follower", "Live"]
