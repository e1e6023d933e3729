"""Check the settings of a solution, and solve a recording as a whole or part by part."""

from .in_parts import read_solver_blocks as read_solver_blocks
from .in_parts import solve_parts as solve_parts
from .in_parts import solve_piece as solve_piece
from .solve_plan import SolvePlan as SolvePlan
from .solve_plan import frames_per_part as frames_per_part
