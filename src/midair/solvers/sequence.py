"""Solve frames one after another, each from the end of the previous one (paper, 4.2 and 5.2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from midair.array_types import Array
from midair.model import Progress, Status
from midair.solvers.problem import Answer, Problem, Start, WarmStart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameAnswer:
    """Result for one frame: x = [theta, psi], iterations made, and status."""

    x: Array
    iterations: int
    status: Status


FrameSolver = Callable[[Array, Array, int], FrameAnswer]
"""(p, initial x, maximum iterations) -> result for one frame."""


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
    """Solve each frame with `one`; silent frames keep the phases.

    `iterations` are the maxima for a frame without and with a warm start. `first` is the initial x of frames without a
    warm start, shape (frame, transducer + point), zero if None. `after` is the end of the previous part.
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
