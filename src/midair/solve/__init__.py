"""Phases for a phased array whose transducers are all equally loud (paper, 4.2)."""

from midair.solve.exact import Exact
from midair.solve.fast import Fast
from midair.solve.levenberg_marquardt import LevenbergMarquardt
from midair.solve.live import Follower, Live
from midair.solve.methods import METHODS, TAKES, solver
from midair.solve.problem import Answer, Problem, Progress, Solver, Start, relative_error
from midair.solve.stage import Fit, solve
from midair.solve.terms.amplitudes import Amplitudes
from midair.solve.terms.cells import Cells
from midair.solve.terms.guard import Guard
from midair.solve.threads import one_blas_thread

__all__ = [
    "METHODS",
    "TAKES",
    "Amplitudes",
    "Answer",
    "Cells",
    "Exact",
    "Fast",
    "Fit",
    "Follower",
    "Guard",
    "LevenbergMarquardt",
    "Live",
    "Problem",
    "Progress",
    "Solver",
    "Start",
    "one_blas_thread",
    "relative_error",
    "solve",
    "solver",
]
