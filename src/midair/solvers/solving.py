"""Solve a target: from sound amplitudes at the control points to a drive."""

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
    """Compute transducer phases whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Target peak sound pressure at each control point, in Pa.
    method : str or a solver
        A name in `METHODS`, or a configured solver such as ``Exact(tolerance=1e-3)``. "lm": Levenberg-Marquardt of
        the paper. "exact": the same steps in the modes of G above .5 % of the strongest, cheaper. "fast": batches
        of independent frames. "glide": whole recordings, by bisection in time. "live": less than a millisecond per
        frame. "naive", "gs", "wgs", "gs-pat", "greedy": published methods for comparison.
    acoustics : Acoustics, optional
        Air and directivity of a transducer; the paper's if None. The drive stores it.
    iterations : int or tuple of int, optional
        Maximum iterations for every frame, or for frames that start at zero and frames that start at the previous
        frame. If None, the default of the method (lm: 50 and 20).
    start : {"previous", "zero"}, optional
        Start of every frame after the first; "zero" makes the frames independent. Only "lm" and "exact" have this
        choice. If None, the setting of the solver, "previous" by default.
    level : float or "auto"
        Drive of every transducer, above 0 to 1. "auto" takes the level that the loudest target needs, see
        `terms.level.automatic_level`. Silent frames get 0.
    amplitudes : {"equal", "bounded"}
        "equal": all transducers at `level`, as in the paper. "bounded": each transducer between 0 and `level`; the
        drive's level then has shape (frame, transducer).
    guard : float or Guard, optional
        Limit the field in a ring around the control points: the width of the ring in m, or a configured term.
    fit : {"points", "windows", "cells"}, Windows or Cells
        Where the error is measured: at the control points; in 8 mm windows that overlap over the whole square; or
        in the cells of a sensor at one place. The reported error is measured there, too.
    smooth : float
        Weight of phase changes between frames: E^2 / 2 plus this times mean(1 - cos(change)) is minimised. 0 turns
        it off; .01 is strong.
    robust : float
        Half the temperature range, 0 to 10 degrees Celsius, around the air of `acoustics`: the root mean square of
        E over the range is minimised. The reported error is that at the temperature of `acoustics`;
        `evaluate.error_at_temperature` gives the others.
    quiet_ears : float
        Weight of the sound at the ears of a person in front of the array: 3 is moderate, 30 strong, 0 turns it off.
    quiet_palm : float or QuietPalm
        Weight of the sound on the palm around the control points, or a configured term: .1 is strong, 0 turns it
        off.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
        Amplitudes are not rounded.
    backend : str, optional
        Array library for "fast" and "glide": "numpy", "torch", "torch:cuda", "cupy".
    jobs : int, optional
        Number of worker threads of "glide"; 1 if None. The result does not depend on it. Other methods ignore it.
    progress : callable, optional
        Called with (frames done, frames in total).

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is out of range or unknown, or the method does not support a term (`TAKES`).
    MissingExtraError
        If the backend, or Numba for "live", is not installed.
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
    """Maximum memory in bytes that `solve`, or `solve_parts` with `parts`, needs with these settings.

    Settings that do not change the memory are accepted and ignored.
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
