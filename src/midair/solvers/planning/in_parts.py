"""Solve recordings of any length part by part, or one piece alone."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import AmplitudeFrames, Progress, Solution, TransducerArray
from midair.solvers.planning.solve_plan import SolvePlan
from midair.solvers.problem import WarmStart
from midair.streaming import blocks, read_frames

Array = NDArray[np.float64]

_READ = 256
"""Frames of a target that are read at once."""


def solve_parts(
    target: AmplitudeFrames, array: TransducerArray, *, progress: Progress | None = None, **settings: Any
) -> Iterator[Solution]:
    """Yield the solution of `solve` part by part, with memory that does not grow with the recording.

    Each part continues from the end of the previous one. Parts end where the method ends a batch or a block, so all
    parts together equal the result of `solve`, except for rounding.

    Parameters
    ----------
    target : AmplitudeFrames
        Its amplitude may be lazy frames, which are read once, and once more for the level "auto".
    progress : callable, optional
        Called with (frames done, frames in total).
    **settings
        As in `solve`.
    """
    return _parts(SolvePlan.of(target, array, **settings), target, progress)


def solve_piece(
    target: AmplitudeFrames, array: TransducerArray, *, marks: Array, loudest: float, **settings: Any
) -> Iterator[Solution]:
    """Yield the solution of one of the `pieces` of a recording, part by part, without the frames before it.

    The phases are bit-identical to those of the whole recording.

    Parameters
    ----------
    target : AmplitudeFrames
        The frames of the piece.
    marks : ndarray, shape (mark, point)
        Amplitude of the piece's marks, in Pa; empty for the first piece.
    loudest : float
        Highest amplitude of the whole recording, in Pa, which determines the level "auto".
    **settings
        As in `solve`, with method "glide".

    Raises
    ------
    InputError
        As in `solve`, or if the method is not "glide".
    """
    order = SolvePlan.of(target, array, loudest=loudest, **settings)
    if not order.leads:
        raise InputError(f"method: expected glide, the only method that solves pieces, got {order.method}")
    after = order.end_of(replace(target, amplitude=marks)) if len(marks) else None
    return _parts(order, target, None, after, marks[-1:])


def _parts(
    order: "SolvePlan",
    target: AmplitudeFrames,
    progress: Progress | None,
    after: WarmStart | None = None,
    lead: Array | None = None,
) -> Iterator[Solution]:
    none = np.zeros((0, target.grid.count))
    lead, rest, done = none if lead is None else lead, none, 0
    for block in chain(blocks(target.amplitude, _READ), [None]):
        rest = rest if block is None else np.concatenate([rest, block])
        while cut := order.joint(rest, first=after is None) or (len(rest) if block is None else 0):
            known = len(lead)
            part = replace(target, amplitude=np.concatenate([lead, rest[:cut]]))
            shifted = None if progress is None else _shifted_progress(progress, done - known, target.frames)
            solution, after = order.solve(part, after, shifted)
            yield solution.cut(known, solution.drive.frames) if known else solution
            sounding = np.flatnonzero(rest[:cut].any(axis=1))
            if order.leads and len(sounding):
                lead = rest[sounding[-1:]]
            rest, done = rest[cut:], done + cut


def read_solver_blocks(amplitude: Array, first: int, last: int) -> Array:
    """Read frames of a target in the same blocks as `solve_parts`.

    Lazy frames are computed on reading, and products of another number of frames differ in the last digit.
    """
    begin = first // _READ * _READ
    read = [read_frames(amplitude, at, min(at + _READ, len(amplitude))) for at in range(begin, last, _READ)]
    return np.concatenate(read)[first - begin : last - begin]


def _shifted_progress(progress: Progress, before: int, frames: int) -> Progress:
    return lambda done, _: progress(before + done, frames)
