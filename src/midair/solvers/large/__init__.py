"""What only large arrays and unusual targets ask for: planes that are tilted, and memory told before it is taken."""

from midair.solvers.large.memory_need import check_memory, memory_needed
from midair.solvers.large.planes import placed, problem_at

__all__ = ["check_memory", "memory_needed", "placed", "problem_at"]
