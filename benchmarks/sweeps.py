"""Print the overhead of a sweep over solving, for numbers of workers and of patterns per task.

Each row is a separate sweep on local processes that are already running. `wall` is wall time, and so is `efficiency`:
patterns per second over those of as many single workers. CPU times are independent of other load: `solve` is that of
the tasks, `workers` the total of their processes meanwhile, `command` that of scheduler and client together, also per
task.

    python -m benchmarks.sweeps

With `--more 600`: the cost of 600 more tasks, with one pattern each by `naive`, for scheduler and client with one
worker.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.clock import heading, line, load, timed
from midair.datasets import stroke
from midair.pipeline import resample_pressure, target_amplitude
from midair.settings import best_mode, paper_mode
from midair.streaming import LazyFrames, blocks
from midair.sweep import PatternSweep, load_sweep, run_sweep
from midair.sweep.run import cluster


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Times in s."""

    wall: float
    solve: float
    workers: float
    command: float


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sweeps", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--workers", type=int, nargs="*", default=[1, 2, 4], help="numbers of processes (default 1 2 4)"
    )
    parser.add_argument("--chunk", type=int, nargs="*", default=[16, 512], help="patterns per task (default 16 512)")
    parser.add_argument("--count", type=int, default=2048, help="patterns per sweep (default 2048)")
    parser.add_argument(
        "--more", type=int, help="number of tasks; print only the cost of one task for scheduler and client"
    )
    parser.add_argument(
        "--targets", action="store_true", help="print only the cost of recordings' targets for the command"
    )
    options = parser.parse_args()
    print(load())
    if options.targets:
        return targets()
    if options.more:
        few, many = (_cost(1, 1, count, method="naive").command for count in (50, 50 + options.more))
        cost = 1e3 * (many - few) / options.more
        print(
            f"{options.more} more tasks: {many - few:.2f} s of scheduler and client, {cost:.1f} ms per task; {load()}"
        )
        return None
    heading("wall s", "patterns/s", "efficiency", "solve s", "workers s", "command s", "ms a task")
    for chunk in options.chunk:
        lone = 0.0
        for workers in options.workers:
            cost = _cost(workers, chunk, options.count)
            rate = options.count / cost.wall
            lone = lone or rate / workers
            each = 1e3 * cost.command / -(-options.count // chunk)
            cells = (cost.wall, rate, rate / workers / lone, cost.solve, cost.workers, cost.command, each)
            line(f"{chunk} a task, {workers} workers", *cells, digits="1121121")
    print(load())
    return None


def targets() -> None:
    """Print the CPU time to compute and read the targets of a towel, which the command does twice for `glide`."""
    for name, settings in (("paper", paper_mode()), ("best", best_mode())):
        felt = resample_pressure(stroke("towel"), settings.target.rate)
        cells = np.tile(felt.pressure, (4, 1, 1))
        reel: np.ndarray = LazyFrames(lambda first, last, cells=cells: cells[first:last], cells.shape)  # pyright: ignore[reportAssignmentType]
        target = target_amplitude(replace(felt, pressure=reel), settings).amplitude
        _, cost = timed(lambda target=target: [block.any(axis=1) for block in blocks(target, 256)])
        print(f"{name}: {1e3 * cost / len(cells):.0f} us per frame")


def _cost(workers: int, chunk: int, count: int, *, method: str = "fast") -> Cost:
    sweep = PatternSweep(count=count, chunk=chunk, strengths=(0.1,), curve_count=0, method=method)
    warm = PatternSweep(count=workers, chunk=1, strengths=(0.1,), curve_count=0)
    with tempfile.TemporaryDirectory() as folder, cluster(workers=workers) as client:
        address = client.scheduler.address
        run_sweep(warm, Path(folder, "warm.zarr"), scheduler=address)
        before = sum(client.run(time.process_time).values()), time.process_time(), time.monotonic()
        run_sweep(sweep, Path(folder, "s.zarr"), scheduler=address)
        wall, command = time.monotonic() - before[2], time.process_time() - before[1]
        busy = sum(client.run(time.process_time).values()) - before[0]
        return Cost(wall=wall, solve=load_sweep(Path(folder, "s.zarr")).seconds, workers=busy, command=command)


if __name__ == "__main__":
    main()
