"""Variants of some computations for a GPU, where launches and waiting cost more than arithmetic."""

from midair.solvers.device.played_phases import phases_and_errors
from midair.solvers.device.ring import RingLBFGS

__all__ = ["RingLBFGS", "phases_and_errors"]
