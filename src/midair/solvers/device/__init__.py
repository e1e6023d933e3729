"""What is done otherwise where a launch and a wait cost more than arithmetic: on a GPU, by any library but NumPy."""

from midair.solvers.device.ring import RingLBFGS
from midair.solvers.device.settling import settled

__all__ = ["RingLBFGS", "settled"]
