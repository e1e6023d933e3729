"""Variants of some computations for a GPU, where launches and waiting cost more than arithmetic."""

from midair.solvers.device.ring import RingLBFGS
from midair.solvers.device.settling import phases_and_errors

__all__ = ["RingLBFGS", "phases_and_errors"]
