"""Phases for a phased array whose transducers are all equally loud (paper, 4.2)."""

from midair.solvers.exact import Exact
from midair.solvers.fast import Fast
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.live import Follower, Live
from midair.solvers.methods import METHODS, TAKES, solver
from midair.solvers.problem import Answer, Problem, Progress, Solver, Start, relative_error
from midair.solvers.solving import Fit, solve
from midair.solvers.terms.amplitudes import Amplitudes
from midair.solvers.terms.cells import Cells
from midair.solvers.terms.guard import Guard
from midair.solvers.threads import one_blas_thread

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
