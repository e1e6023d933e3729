"""Measure times and print table rows."""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np

from midair.solvers import Live, Problem


def timed(work: Callable[[], object]) -> tuple:
    """Return the result and its CPU time in this process, in ms."""
    start = time.process_time()
    result = work()
    return result, 1e3 * (time.process_time() - start)


def fastest(work: Callable[[], object], times: int = 40) -> float:
    """Minimum CPU time of many runs, in ms."""
    work()
    taken = []
    for _ in range(times):
        start = time.thread_time()
        work()
        taken.append(time.thread_time() - start)
    return 1e3 * min(taken)


def frame_times(settings: Live, problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phases of all frames, and wall and CPU time of each frame with sound after the first, in ms.

    Python's garbage collector is disabled meanwhile, as recommended for a real-time loop.
    """
    follower, phases, wall, cpu = settings.begin(problem), [], [], []
    with _no_collection():
        for p in problem.amplitude:
            start = time.perf_counter(), time.thread_time()
            phases.append(follower.follow(p))
            if p.any():
                wall.append(1e3 * (time.perf_counter() - start[0]))
                cpu.append(1e3 * (time.thread_time() - start[1]))
    return np.stack(phases), np.array(wall[1:]), np.array(cpu[1:])


def load() -> str:
    """Text with the load of the machine, if it is known."""
    if not hasattr(os, "getloadavg"):
        return "load unknown"
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def heading(*columns: str) -> None:
    """Print the header of a table."""
    print(f"{'':36}" + "".join(f"{column:>10}" for column in columns), flush=True)


def line(label: str, *cells: float | None, digits: str = "") -> None:
    """Print one row; `digits` has the number of decimals of each cell, one character each."""
    text = [" " * 10 if cell is None else f"{cell:10.{digit}f}" for cell, digit in zip(cells, digits, strict=True)]
    print(f"{label:36}" + "".join(text), flush=True)


@contextmanager
def _no_collection():
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
