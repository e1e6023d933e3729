"""Tilted planes, and an estimate of the memory that a problem needs."""

from midair.solvers.large.memory_need import check_memory, memory_needed
from midair.solvers.large.planes import multi_plane_problem, place_grid

__all__ = ["check_memory", "memory_needed", "place_grid", "multi_plane_problem"]
