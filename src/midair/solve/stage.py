"""From the sound amplitude that is wanted to the drive that makes it: the stage of the pipeline."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from midair.errors import InputError
from midair.model import AmplitudeFrames, Drive, Medium, Solution, TransducerArray
from midair.physics import Directivity, transfer_matrix
from midair.solve.levenberg_marquardt import LevenbergMarquardt
from midair.solve.problem import Problem, Progress, Start, relative_error

METHODS: Mapping[str, Callable[[], LevenbergMarquardt]] = MappingProxyType({"lm": LevenbergMarquardt})
"""Name of each method and how to make it with its default settings."""


def solve(
    target: AmplitudeFrames,
    array: TransducerArray,
    *,
    method: str = "lm",
    medium: Medium | None = None,
    directivity: Directivity = "t4010a1",
    iterations: int | tuple[int, int] | None = None,
    start: Start = "previous",
    level: float = 1.0,
    progress: Progress | None = None,
) -> Solution:
    """Phases of all transducers, equally loud, whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Peak sound pressure wanted at each control point, in Pa.
    array : TransducerArray
        What is to make it.
    method : {"lm"}
        "lm": the paper's Levenberg-Marquardt.
    medium, directivity
        As in `physics.transfer_matrix`.
    iterations : int or tuple of int, optional
        At most, for every frame; or for frames that start at zero and for those that start at the previous frame.
        The method's own (lm: 50 and 20) if None.
    start : {"previous", "zero"}
        Of every frame after the first; "zero" makes the frames independent.
    level : float
        Drive of every transducer, above 0 to 1. Frames with nothing to play get 0.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is out of range or unknown.
    """
    if not 0 < level <= 1:
        raise InputError(f"level: expected above 0 and at most 1 of full drive, got {level:g}")
    solver = _solver(method, iterations, start)
    problem = _problem(target, array, medium or Medium(), directivity, level)
    from threadpoolctl import threadpool_limits

    # Two BLAS threads are about three times slower than one on matrices of this size: they spin and wait.
    with threadpool_limits(limits=1, user_api="blas"):
        answer = solver.solve(problem, progress=progress)
        error = relative_error(problem, answer.phase)
    audible = np.array([status != "silent" for status in answer.status])
    settings = {
        "method": method,
        "iterations": (solver.iterations, solver.warm_iterations),
        "start": start,
        "level": level,
        "directivity": directivity,
        "array": array.name,
    }
    drive = Drive(
        phase=np.mod(answer.phase, 2 * np.pi),
        level=np.where(audible, level, 0.0),
        rate=target.rate,
        array=array,
        provenance=target.provenance.then("solve", settings),
    )
    return Solution(drive=drive, error=error, iterations=answer.iterations, status=answer.status)


def _solver(method: str, iterations: int | tuple[int, int] | None, start: Start) -> LevenbergMarquardt:
    if method not in METHODS:
        raise InputError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
    if start not in ("previous", "zero"):
        raise InputError(f"start: expected previous or zero, got {start!r}")
    solver = replace(METHODS[method](), start=start)
    if iterations is None:
        return solver
    first, warm = (iterations, iterations) if isinstance(iterations, int) else iterations
    if first < 1 or warm < 1:
        raise InputError(f"iterations: expected 1 or more, got {iterations}")
    return replace(solver, iterations=first, warm_iterations=warm)


def _problem(
    target: AmplitudeFrames, array: TransducerArray, medium: Medium, directivity: Directivity, level: float
) -> Problem:
    G = transfer_matrix(target.grid, array, medium=medium, directivity=directivity)
    focus = np.abs(G).sum(axis=1).max()
    return Problem(G=G / focus, amplitude=target.amplitude / focus, level=level)
