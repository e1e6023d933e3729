"""How a recording is to be solved: its settings checked and brought together, whole or part by part."""

from midair.solvers.ordering.in_parts import read_as_solved, solve_parts, solve_piece
from midair.solvers.ordering.solve_order import SolveOrder, together

__all__ = ["SolveOrder", "read_as_solved", "solve_parts", "solve_piece", "together"]
