"""Phases for a phased array whose transducers are all equally loud (paper, 4.2)."""

from midair.solve.levenberg_marquardt import LevenbergMarquardt
from midair.solve.problem import Answer, Problem, Progress, Solver, Start, relative_error
from midair.solve.stage import METHODS, solve

__all__ = [
    "METHODS",
    "Answer",
    "LevenbergMarquardt",
    "Problem",
    "Progress",
    "Solver",
    "Start",
    "relative_error",
    "solve",
]
