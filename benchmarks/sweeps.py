"""Print the overhead of a sweep over solving, for numbers of workers and of patterns per task.

Each row is a separate sweep on local processes that are already running. `wall` is wall time, and so is `efficiency`:
patterns per second over those of as many single workers. CPU times are independent of other load: `solve` is that of
the tasks, `workers` the total of their processes meanwhile, `command` that of scheduler and client together, also per
task.

    python -m benchmarks.sweeps
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.clock import heading, line, load
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
    options = parser.parse_args()
    print(load())
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


def _cost(workers: int, chunk: int, count: int) -> Cost:
    sweep = PatternSweep(count=count, chunk=chunk, strengths=(0.1,))
    warm = PatternSweep(count=workers, chunk=1, strengths=(0.1,))
    with tempfile.TemporaryDirectory() as folder, cluster(workers=workers) as client:
        address = client.scheduler.address
        run_sweep(warm, Path(folder, "warm"), scheduler=address)
        before = sum(client.run(time.process_time).values()), time.process_time(), time.monotonic()
        run_sweep(sweep, Path(folder, "s"), scheduler=address)
        wall, command = time.monotonic() - before[2], time.process_time() - before[1]
        busy = sum(client.run(time.process_time).values()) - before[0]
        return Cost(wall=wall, solve=load_sweep(Path(folder, "s")).seconds, workers=busy, command=command)


if __name__ == "__main__":
    main()
