"""Check the settings of a solution, and solve a recording as a whole or part by part."""

from midair.solvers.planning.in_parts import read_solver_blocks, solve_parts, solve_piece
from midair.solvers.planning.solve_plan import SolvePlan, frames_per_part

__all__ = ["SolvePlan", "read_solver_blocks", "solve_parts", "solve_piece", "frames_per_part"]
