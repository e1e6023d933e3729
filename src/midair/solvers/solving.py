"""From the sound amplitude that is wanted to the drive that makes it: the stage of the pipeline."""

from typing import Any, Literal

from midair.model import Acoustics, AmplitudeFrames, Progress, Solution, TransducerArray
from midair.solvers.amplitudes import Amplitudes
from midair.solvers.large import memory_needed
from midair.solvers.methods import Method, name_of
from midair.solvers.methods import solver as solver_of
from midair.solvers.planning import SolvePlan, frames_per_part
from midair.solvers.problem import Start
from midair.solvers.terms import Fit, Guard, QuietPalm, airs_around


def solve(
    target: AmplitudeFrames,
    array: TransducerArray,
    *,
    method: str | Method = "lm",
    acoustics: Acoustics | None = None,
    iterations: int | tuple[int, int] | None = None,
    start: Start | None = None,
    level: float | Literal["auto"] = 1.0,
    amplitudes: Amplitudes = "equal",
    guard: float | Guard | None = None,
    fit: Fit = "points",
    smooth: float = 0.0,
    robust: float = 0.0,
    quiet_ears: float = 0.0,
    quiet_palm: float | QuietPalm = 0.0,
    bits: int | None = None,
    backend: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Phases of all transducers, equally loud, whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Peak sound pressure wanted at each control point, in Pa.
    array : TransducerArray
        What is to make it.
    method : str or a solver
        A name in `methods.METHODS`, or a configured solver of `midair.solvers` such as ``Exact(tolerance=1e-3)``.
        "lm": the paper's Levenberg-Marquardt. "exact": the same in the modes of G above .5 % of the strongest,
        cheaper. "fast": many frames at once, each on its own. "glide": a recording as a whole, by bisection in time.
        "live": within a millisecond a frame. "naive", "gs", "wgs", "gs-pat", "greedy": published methods to compare
        with.
    acoustics : Acoustics, optional
        The air and the directivity of a transducer; the paper's if None. The drive carries it.
    iterations : int or tuple of int, optional
        Largest number, for every frame or for frames that start at zero and those that start at the previous frame.
        The method's own (lm: 50 and 20) if None.
    start : {"previous", "zero"}, optional
        Start of every frame after the first; "zero" makes the frames independent. Only "lm" and "exact" have the
        choice; the solver's own, "previous" unless configured, if None.
    level : float or "auto"
        Drive of every transducer, above 0 to 1. "auto": as much as the loudest target needs, see
        `terms.level.automatic_level`. Frames with nothing to play get 0.
    amplitudes : {"equal", "bounded"}
        All transducers at `level`, as in the paper; or each at its own, between 0 and `level`, and the drive's level
        is then (frame, transducer).
    guard : float or Guard, optional
        Keeps a ring around the control points quiet: its width in m, or the term with all its settings.
    fit : {"points", "windows", "cells"}, Windows or Cells
        What is to be met: the target at the control points; what windows of the size of a cell read of it all over the
        square; or what the cells of a sensor read of it, for that one place of the sensor alone. The error is that of
        what was to be met.
    smooth : float
        Weight of the change of phase from frame to frame, see `terms.smooth`: E^2 / 2 plus this times
        mean(1 - cos(change)) is made small. 0 for none; .01 is much.
    robust : float
        Degrees Celsius, 0 to 10, by which the air may be colder or warmer than that of `acoustics`: the root mean
        square of E over that range is made small, see `terms.temperatures`. The error that is told is that of
        `acoustics`; `evaluate.error_in_air` tells the others. 0 for that air alone.
    quiet_ears : float
        Weight of the sound at the ears of a person in front of the array, see `terms.quiet_ears`: 3 is some, 30 much.
        0 for none.
    quiet_palm : float or QuietPalm
        Weight of the sound on a palm around the control points, see `terms.quiet_palm`, or the term with all its
        settings: .1 is much. 0 for none.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
        Not rounded if None. Amplitudes are not rounded.
    backend : str, optional
        What does the arithmetic of "fast" and "glide": "numpy", "torch", "torch:cuda", "cupy"; see `backend.backend`.
    jobs : int, optional
        Blocks that "glide" solves at once, which changes nothing but the time; 1 if None. The other methods have none.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is out of range or unknown, or the method does not take a term (`methods.TAKES`).
    MissingExtraError
        If a backend, or Numba for "live", is not installed.
    """
    order = SolvePlan.of(
        target,
        array,
        method=method,
        acoustics=acoustics,
        iterations=iterations,
        start=start,
        level=level,
        amplitudes=amplitudes,
        guard=guard,
        fit=fit,
        smooth=smooth,
        robust=robust,
        quiet_ears=quiet_ears,
        quiet_palm=quiet_palm,
        bits=bits,
        backend=backend,
        jobs=jobs,
    )
    return order.solve(target, None, progress)[0]


def memory_of(
    target: AmplitudeFrames,
    array: TransducerArray,
    *,
    method: str | Method = "lm",
    acoustics: Acoustics | None = None,
    amplitudes: Amplitudes = "equal",
    guard: float | Guard | None = None,
    robust: float = 0.0,
    quiet_palm: float | QuietPalm = 0.0,
    backend: str | None = None,
    jobs: int | None = None,
    parts: bool = False,
    **_: Any,
) -> int:
    """Bytes that `solve` with these settings, or `solve_parts`, takes at most at once; see `large.memory_needed`.

    Parameters
    ----------
    target, array, method, acoustics, amplitudes, guard, robust, quiet_palm, backend, jobs
        As in `solve`; its other settings do not count.
    parts : bool
        Whether no more than a part is in memory.
    """
    ring = Guard(margin=guard) if isinstance(guard, int | float) else guard
    palm = quiet_palm if isinstance(quiet_palm, QuietPalm) else QuietPalm() if quiet_palm > 0 else None
    quiet = [] if ring is None else [ring.ring(target.grid)]
    quiet += [] if palm is None else [palm.points(target.grid)]
    whole = frames_per_part(solver_of(method, backend=backend, jobs=jobs)) if parts else target.frames
    return memory_needed(
        target.grid.count,
        array.count * (2 if amplitudes == "bounded" else 1),
        min(target.frames, whole),
        method=name_of(method),
        guard=sum(len(each) for each in quiet),
        airs=len(airs_around(acoustics or Acoustics(), robust)),
    )
