"""Frames one after another, each from where the one before it ended (paper, 4.2 and 5.2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.model import Progress, Status
from midair.solvers.problem import Answer, Problem, Start, WarmStart

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameAnswer:
    """What came of one frame: x = [theta, psi], iterations made, and how it ended."""

    x: Array
    iterations: int
    status: Status


FrameSolver = Callable[[Array, Array, int], FrameAnswer]
"""(p, first x, most iterations) -> answer of one frame."""


def solve_in_turn(
    problem: Problem,
    one: FrameSolver,
    *,
    iterations: tuple[int, int],
    start: Start,
    first: Array | None = None,
    after: WarmStart | None = None,
    progress: Progress | None = None,
) -> Answer:
    """Solve each frame with `one`; a frame without any target is silent and hands the phases on as they are.

    Parameters
    ----------
    problem : Problem
        G and the targets.
    one : callable
        Solves one frame.
    iterations : tuple of int
        Largest numbers for a frame on its own, and for one that starts at the previous frame.
    start : {"previous", "zero"}
        Start of every frame after the first; with "zero" each is on its own.
    first : ndarray, shape (frame, transducer + point), optional
        x that a frame on its own starts from; zero if None.
    after : End, optional
        Where the frame before the first one ended.
    progress : callable, optional
        Called with (frames done, frames in all).

    Returns
    -------
    Answer
        Of all frames.
    """
    frames = len(problem.amplitude)
    x = np.zeros(problem.transducers + problem.points)
    begin = np.broadcast_to(x, (frames, len(x))) if first is None else first
    phase = np.zeros((frames, problem.transducers))
    made = np.zeros(frames, np.int64)
    status: list[Status] = []
    if after is not None:
        x = after.known
    warm = after is not None
    for frame, p in enumerate(problem.amplitude):
        if p.any():
            fresh = start == "zero" or not warm
            answer = one(p, begin[frame] if fresh else x, iterations[0] if fresh else iterations[1])
            x, warm, made[frame] = answer.x, True, answer.iterations
            status.append(answer.status)
        else:
            status.append("silent")
        phase[frame] = x[: problem.transducers]
        if progress is not None:
            progress(frame + 1, frames)
    end = WarmStart(theta=x[: problem.transducers], known=x) if warm else None
    return Answer(phase=phase, iterations=made, status=tuple(status), end=end)
