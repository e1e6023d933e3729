"""From the sound amplitude that is wanted to the drive that makes it: the stage of the pipeline."""

from dataclasses import fields

import numpy as np

from midair.errors import InputError
from midair.model import AmplitudeFrames, Drive, Medium, Setting, Solution, TransducerArray
from midair.physics import Directivity, quantise_phase, transfer_matrix
from midair.solve.lens import spreading_phase
from midair.solve.methods import Method
from midair.solve.methods import solver as solver_of
from midair.solve.problem import Problem, Progress, Start, relative_error
from midair.solve.threads import one_blas_thread


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
    bits: int | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Phases of all transducers, equally loud, whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Peak sound pressure wanted at each control point, in Pa.
    array : TransducerArray
        What is to make it.
    method : str
        A name in `methods.METHODS`. "lm": the paper's Levenberg-Marquardt. "exact": the same in the modes of G
        above .5 % of the strongest, cheaper. "fast":
        many frames at once, each on its own. "live": within a millisecond a frame. "naive", "gs", "wgs", "gs-pat",
        "greedy": published methods to compare with.
    medium, directivity
        As in `physics.transfer_matrix`.
    iterations : int or tuple of int, optional
        At most, for every frame; or for frames that start at zero and for those that start at the previous frame.
        The method's own (lm: 50 and 20) if None.
    start : {"previous", "zero"}
        Of every frame after the first; "zero" makes the frames independent. Only "lm" and "exact" have the choice.
    level : float
        Drive of every transducer, above 0 to 1. Frames with nothing to play get 0.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
        Not rounded if None.
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
    solver = solver_of(method, iterations=iterations, start=start)
    if bits is not None and not 1 <= bits <= 16:
        raise InputError(f"bits: expected 1 to 16 of a phase, or None, got {bits}")
    problem = _problem(target, array, medium or Medium(), directivity, level)
    with one_blas_thread():
        answer = solver.solve(problem, progress=progress)
        phase = np.mod(answer.phase, 2 * np.pi) if bits is None else quantise_phase(answer.phase, bits=bits)
        error = relative_error(problem, phase, answer.level)
    audible = np.array([status != "silent" for status in answer.status])
    settings: dict[str, Setting] = {"method": method, "level": level, "bits": bits, "directivity": directivity}
    drive = Drive(
        phase=phase,
        level=np.where(audible, level * (1.0 if answer.level is None else answer.level), 0.0),
        rate=target.rate,
        array=array,
        provenance=target.provenance.then("solve", settings | {"array": array.name} | _settings(solver)),
    )
    return Solution(drive=drive, error=error, iterations=answer.iterations, status=answer.status)


def _settings(solver: Method) -> dict[str, Setting]:
    """The fields of a solver, for the record."""
    return {field.name: getattr(solver, field.name) for field in fields(solver)}


def _problem(
    target: AmplitudeFrames, array: TransducerArray, medium: Medium, directivity: Directivity, level: float
) -> Problem:
    G = transfer_matrix(target.grid, array, medium=medium, directivity=directivity)
    focus = np.abs(G).sum(axis=1).max()
    return Problem(
        G=G / focus,
        amplitude=target.amplitude / focus,
        level=level,
        psi=spreading_phase(target.grid, array, medium),
    )
