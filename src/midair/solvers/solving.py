"""Solve a target, from sound amplitudes at the control points to a drive: as a whole, or part by part."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from midair.model import Acoustics, AmplitudeFrames, Progress, Solution, TransducerArray
from midair.solvers.methods import SolverSettings
from midair.solvers.solve_plan import SolvePlan, fits_at_once
from midair.streaming import blocks
from midair.validation import checked_call


@checked_call
def solve(
    target: AmplitudeFrames,
    array: TransducerArray,
    settings: SolverSettings | None = None,
    *,
    acoustics: Acoustics | None = None,
    bits: int | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> Solution:
    """Compute transducer phases whose field comes closest to the target, frame by frame.

    Parameters
    ----------
    target : AmplitudeFrames
        Target peak sound pressure at each control point, in Pa.
    settings : SolverSettings, optional
        The solver group of `Settings`; if None, the method of the paper, "lm", without further terms.
    acoustics : Acoustics, optional
        Air and directivity of a transducer; the paper's if None. The drive stores it.
    bits : int, optional
        Round phases to 2 pi / 2^bits, as firmware does (8 bits: AUTD3); the error is that of the rounded phases.
        Amplitudes are not rounded.
    progress : callable, optional
        Called with (frames done, frames in total).
    **changes
        Settings by name, in place of those of `settings`: ``solve(target, array, method="fast", guard=0.02)``; see
        `SolverSettings`. The reported error is that in the nominal air.

    Returns
    -------
    Solution
        Drive, error and status of each frame. Not converging is a status, never an exception.

    Raises
    ------
    InputError
        If a setting is out of range or unknown, or the method does not support a term (`takes`).
    MissingExtraError
        If the backend, or Numba for "live", is not installed.
    """
    plan = SolvePlan.of(target, array, settings, acoustics=acoustics, bits=bits, **changes)
    return plan.solve(target, None, progress)[0]


_READ = 256
"""Frames of a target that are read at once."""


def solve_parts(
    target: AmplitudeFrames,
    array: TransducerArray,
    settings: SolverSettings | None = None,
    *,
    early: bool = True,
    progress: Progress | None = None,
    **changes: Any,
) -> Iterator[Solution]:
    """Yield the solution of `solve` part by part, with memory that does not grow with the recording.

    Each part continues from the end of the previous one. Parts end where the method ends a batch or a block, so all
    parts together equal the result of `solve`, except for rounding. Unless the first part has to be there `early`, a
    target of at most two parts is solved at once, which leaves fewer cores idle.

    The target's amplitude may be lazy frames, which are read once, and once more for the level "auto". The parameters
    are those of `solve`.
    """
    return _parts(SolvePlan.of(target, array, settings, **changes), target, progress, early)


def _parts(order: SolvePlan, target: AmplitudeFrames, progress: Progress | None, early: bool) -> Iterator[Solution]:
    whole = not early and fits_at_once(target.frames, order.solver)
    lead = rest = np.zeros((0, target.grid.count))
    done, after = 0, None
    read = blocks(target.amplitude, _READ)
    for block in chain([np.concatenate([*read])] if whole else read, [None]):
        rest = rest if block is None else np.concatenate([rest, block])
        while cut := (not whole and order.joint(rest, first=after is None)) or (len(rest) if block is None else 0):
            known = len(lead)
            part = replace(target, amplitude=np.concatenate([lead, rest[:cut]]))
            shifted = None if progress is None else _shifted_progress(progress, done - known, target.frames)
            solution, after = order.solve(part, after, shifted)
            yield solution.cut(known, solution.drive.frames) if known else solution
            sounding = np.flatnonzero(rest[:cut].any(axis=1))
            if order.leads and len(sounding):
                lead = rest[sounding[-1:]]
            rest, done = rest[cut:], done + cut


def _shifted_progress(progress: Progress, before: int, frames: int) -> Progress:
    return lambda done, _: progress(before + done, frames)
