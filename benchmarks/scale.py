"""Time and memory of the solvers over the number of transducers and control points: `python -m benchmarks.scale`.

Each row is a separate process with one BLAS thread. The table has CPU times (the minimum for the live solver), the
largest resident set minus that of the libraries, and the estimate of `memory_needed`. Targets are random cells of a
sensor, interpolated as in the paper, at strength .1, with the same seed for every size.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clock import load
from midair.model import Acoustics, ControlGrid, Medium, SensorGrid, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers import Live, Problem, memory_needed, multi_plane_problem, one_blas_thread, place_grid, solver
from midair.solvers.modes import modes
from midair.solvers.phases import spreading_phase
from midair.targets import interpolation_matrix

ACOUSTICS = Acoustics(medium=Medium(attenuation=0), directivity="point")
SIZES = ("2 16", "2 32", "2 32 fine", "2 16 hands", "4 16", "4 32", "4 64", "8 32", "8 64")
COLUMNS = (
    "transducers",
    "points",
    "rank",
    "G s",
    "modes s",
    "fast ms",
    "glide ms",
    "exact s",
    "live ms",
    "MB",
    "told MB",
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scale", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--sizes", nargs="*", default=list(SIZES), help='sizes "UNITS POINTS [fine|hands]", both per side'
    )
    parser.add_argument("--methods", nargs="*", default=["fast", "glide", "exact", "live"])
    parser.add_argument("--most", type=float, default=6.0, help="largest estimated memory of a row in GB (default 6)")
    parser.add_argument("--row", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        with one_blas_thread():
            print(json.dumps(row(options.row, options.methods)))
        return
    print(load())
    print("| array, grid | " + " | ".join(COLUMNS) + " |\n|" + "---|" * (len(COLUMNS) + 1), flush=True)
    for size in options.sizes:
        units, side = (int(word) for word in size.split()[:2])
        needed = memory_needed(side**2 * (2 if "hands" in size else 1), 249 * units**2, 16, method="fast")
        if needed > 1e9 * options.most:
            print(f"| {size} | skipped: needs {needed / 1e9:.1f} GB |", flush=True)
            continue
        words = [sys.executable, "-m", "benchmarks.scale", "--row", size, "--methods", *options.methods]
        made = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False)
        found = json.loads(made.stdout) if made.returncode == 0 else {}
        cells = [shown(found[name]) if name in found else "" for name in COLUMNS]
        print(f"| {size} | " + " | ".join(cells) + " |", flush=True)


def shown(number: float) -> str:
    """Two digits for small numbers, whole numbers otherwise."""
    return f"{number:.2g}" if number < 10 else f"{number:.0f}"


def row(size: str, methods: list[str]) -> dict[str, float]:
    """One row of the table."""
    for name in methods:
        solver(name).solve(tiny())
    before = resident()
    problem, taken = timed(lambda: problem_of(size))
    found: dict[str, float] = {"transducers": problem.transducers, "points": problem.points, "G s": taken}
    kept, found["modes s"] = timed(lambda: modes(problem.G, tolerance=5e-3))
    found["rank"] = kept.rank
    del kept
    frames = len(problem.amplitude)
    if "fast" in methods:
        found["fast ms"] = 1e3 * (timed(lambda: solver("fast").solve(problem))[1] - found["modes s"]) / frames
    found["MB"] = (resident() - before) / 1e6
    found["told MB"] = memory_needed(problem.points, problem.transducers, frames, method="fast") / 1e6
    if "glide" in methods:
        slow = replace(problem, amplitude=between(problem.amplitude, 65))
        _, least = timed(lambda: modes(problem.G, tolerance=2e-3))
        found["glide ms"] = 1e3 * (timed(lambda: solver("glide").solve(slow))[1] - least) / len(slow.amplitude)
    if "exact" in methods:
        alone = replace(problem, amplitude=problem.amplitude[:1])
        found["exact s"] = timed(lambda: solver("exact").solve(alone))[1]
    if "live" in methods:
        follower = Live().begin(problem)
        times = [timed(partial(follower.follow, p))[1] for p in problem.amplitude]
        found["live ms"] = 1e3 * min(times[1:])
    return found


def problem_of(size: str) -> Problem:
    """Array, grid and sixteen random patterns of one size."""
    units, side, *kind = size.split()
    array, points = TransducerArray.autd3(columns=int(units), rows=int(units)), int(side)
    fine = "fine" in kind
    grid = ControlGrid(rows=points, columns=points, pitch=55e-3 / (points - 1) if fine else ControlGrid().pitch)
    cells = 4 if fine else points // 4
    weights = interpolation_matrix(SensorGrid(rows=cells, columns=cells), grid)
    amplitude = (np.random.default_rng(0).random((16, cells**2)) < 0.5) @ weights.T
    if "hands" in kind:
        planes = [
            place_grid(grid, centre=(-0.06, 0.0, 0.15), normal=(0.34, 0.0, 0.94)),
            place_grid(grid, centre=(0.06, 0.0, 0.22), normal=(-0.34, 0.0, 0.94)),
        ]
        problem = multi_plane_problem(planes, np.hstack([amplitude, amplitude[::-1]]), array, acoustics=ACOUSTICS)
        return replace(problem, amplitude=0.1 * problem.amplitude / problem.amplitude.max())
    G = transfer_matrix(grid, array, acoustics=ACOUSTICS)
    np.divide(G, np.abs(G).sum(axis=1).max(), out=G)
    psi = spreading_phase(grid, array, ACOUSTICS.medium)
    return Problem(G=G, amplitude=0.1 * amplitude, psi=psi, position=array.position)


def tiny() -> Problem:
    """A tiny problem that makes the libraries load and compile before the measurement."""
    return replace(problem_of("1 4"), amplitude=np.full((2, 16), 0.05))


def between(amplitude: np.ndarray, frames: int) -> np.ndarray:
    """Linear transitions between the first three patterns."""
    at = np.linspace(0, 2, frames)[:, None]
    near = np.maximum(0, 1 - np.abs(at - np.arange(3)))
    return near @ amplitude[:3]


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return the result and its CPU time in s."""
    start = time.process_time()
    made = work()
    return made, time.process_time() - start


def resident() -> int:
    """Largest resident set so far, in bytes."""
    # ru_maxrss would include the peak of the parent program.
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


if __name__ == "__main__":
    main()
