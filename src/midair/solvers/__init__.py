"""Solvers for the phases of a phased array whose transducers all have the same amplitude (paper, 4.2)."""

from midair.solvers.amplitudes import Amplitudes
from midair.solvers.exact import Exact
from midair.solvers.fast import Fast
from midair.solvers.glide import Glide, Piece, pieces
from midair.solvers.initial_phase import spreading_phase
from midair.solvers.large import check_memory, memory_needed, multi_plane_problem, place_grid
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.live import FrameTracker, Live, symmetric_modes
from midair.solvers.methods import METHODS, TAKES, Method, check_terms, name_of, solver, terms_of
from midair.solvers.planning import read_solver_blocks, solve_parts, solve_piece
from midair.solvers.problem import Answer, Problem, Solver, Start, error_of
from midair.solvers.solving import memory_of, solve
from midair.solvers.terms import Cells, Fit, Guard, QuietPalm, Windows, pressure_means
from midair.solvers.threads import one_blas_thread

__all__ = [
    "Amplitudes",
    "Answer",
    "Cells",
    "Exact",
    "Fast",
    "Fit",
    "FrameTracker",
    "Glide",
    "Guard",
    "LevenbergMarquardt",
    "Method",
    "Live",
    "METHODS",
    "Piece",
    "Problem",
    "QuietPalm",
    "Solver",
    "Start",
    "TAKES",
    "Windows",
    "check_memory",
    "check_terms",
    "pressure_means",
    "memory_needed",
    "memory_of",
    "name_of",
    "one_blas_thread",
    "error_of",
    "symmetric_modes",
    "pieces",
    "place_grid",
    "multi_plane_problem",
    "read_solver_blocks",
    "solve",
    "solve_parts",
    "solve_piece",
    "solver",
    "spreading_phase",
    "terms_of",
]
