"""Tilted planes, and an estimate of the memory that a problem needs."""

from midair.solvers.large.memory_need import check_memory, memory_needed
from midair.solvers.large.planes import placed, problem_at

__all__ = ["check_memory", "memory_needed", "placed", "problem_at"]
