"""Memory of solving a whole recording over its length: `python -m benchmarks.reels`.

A moving, vibrating spot is computed while it is read, at 1 kHz, and solved part by part with `glide`, as `midair solve`
does; the results are discarded. Each row is a separate process with one BLAS thread. The table has the largest resident
set minus that of the libraries, the estimate of `memory_of`, and CPU time. One unit with 6 x 6 points is fast enough
for ten minutes; the rows with the paper's array and grid are shorter.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time

import numpy as np

from benchmarks.clock import load
from benchmarks.scale import resident
from midair.model import AmplitudeFrames, ControlGrid, Provenance, TransducerArray
from midair.solvers import memory_of, one_blas_thread, solve_parts
from midair.streaming import LazyFrames

RATE = 1000.0
ROWS = ("small 30", "small 120", "small 600", "paper 5", "paper 20")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reels", description=__doc__.splitlines()[0])
    parser.add_argument("--rows", nargs="*", default=list(ROWS), help='rows "small|paper SECONDS" (default all)')
    parser.add_argument("--jobs", type=int, default=1, help="number of parallel blocks (default 1)")
    parser.add_argument("--row", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        with one_blas_thread():
            print(json.dumps(row(options.row, options.jobs)))
        return
    print(f"{load()}; {options.jobs} at once")
    print("| array, grid | s of touch | frames | MB | told MB | CPU s |\n|---|---|---|---|---|---|", flush=True)
    for name in options.rows:
        words = [sys.executable, "-m", "benchmarks.reels", "--row", name, "--jobs", str(options.jobs)]
        found = json.loads(subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout)
        size, seconds = name.split()
        cells = (size, seconds, found["frames"], *(f"{found[key]:.0f}" for key in ("MB", "told MB", "CPU s")))
        print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def row(name: str, jobs: int) -> dict[str, float]:
    """One row of the table."""
    size, seconds = name.split()
    small = size == "small"
    array = TransducerArray.autd3(columns=1, rows=1) if small else TransducerArray.autd3()
    grid = ControlGrid(rows=6, columns=6, pitch=11e-3) if small else ControlGrid()
    for _ in solve_parts(spot(grid, 40), array, method="glide", jobs=jobs):
        pass  # exclude the memory that libraries need to load and compile
    before, start = resident(), time.process_time()
    target = spot(grid, round(float(seconds) * RATE))
    frames = sum(len(part.error) for part in solve_parts(target, array, method="glide", jobs=jobs))
    told = memory_of(target, array, method="glide", parts=True, jobs=jobs)
    return {
        "frames": frames,
        "MB": (resident() - before) / 1e6,
        "told MB": told / 1e6,
        "CPU s": time.process_time() - start,
    }


def spot(grid: ControlGrid, frames: int) -> AmplitudeFrames:
    """A spot of 9 mm that circles at .5 Hz and vibrates at 40 Hz, with up to 800 Pa of sound pressure."""
    x, y = (axis.ravel() for axis in np.meshgrid(grid.x, grid.y))

    def read(first: int, last: int) -> np.ndarray:
        at = np.arange(first, last)[:, None] / RATE
        apart = (x - 12e-3 * np.cos(np.pi * at)) ** 2 + (y - 12e-3 * np.sin(np.pi * at)) ** 2
        return 400 * (1 - np.cos(2 * np.pi * 40 * at)) * np.exp(-apart / (2 * 9e-3**2))

    origin = Provenance(source="virtual:benchmark", simulated=True)
    amplitude: np.ndarray = LazyFrames(read, (frames, grid.count))  # pyright: ignore[reportAssignmentType]
    return AmplitudeFrames(amplitude=amplitude, rate=RATE, grid=grid, provenance=origin)


if __name__ == "__main__":
    main()
