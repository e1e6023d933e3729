"""Console output of sweeps: progress bar and result tables."""

import os
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table as Shown

from midair.cli.console import banner, bars, err, out, verbosity
from midair.cli.time_estimates import estimate_text, remember_speed
from midair.errors import InputError
from midair.model import Progress as Advance
from midair.sweep import PatternReport, PatternSweep, Sweep, TrialReport, run_sweep

_STORE = "NAME.zarr, new or of the same sweep; or an address that fsspec can open."
_SCHEDULER = "Address of a Dask scheduler, such as tls://host:8786. [default: processes on this computer]"
Store = Annotated[str, Parameter(help=_STORE)]
Bits = Annotated[int, Parameter(help="Bits to which phases are rounded for the second E.")]
Scheduler = Annotated[str | None, Parameter(help=_SCHEDULER)]
Workers = Annotated[int | None, Parameter(help="Processes on this computer. [default: one per core]")]


def run_with_bar(sweep: Sweep, where: str, *, scheduler: str | None, workers: int | None) -> int:
    """Run a sweep with a progress bar and return the exit status."""
    if not where.rstrip("/").endswith(".zarr"):
        raise InputError(f"{where}: expected a name that ends in .zarr for a sweep")
    try:
        # Everything that decides the speed.
        method = f" {sweep.method}" if isinstance(sweep, PatternSweep) else ""
        workload = f"{sweep.kind}{method} {os.cpu_count()} cores"
        with sweep_bar("patterns" if sweep.kind == "patterns" else "frames", workload) as progress:
            run_sweep(sweep, where, scheduler=scheduler, workers=workers, progress=progress)
    except KeyboardInterrupt:
        err().print("midair: stopped; the results so far are stored; run the same command again to resume")
        return 130
    return 0


@contextmanager
def sweep_bar(items: str, workload: str) -> Generator[Advance]:
    """A progress bar on stderr, with a time estimate before; the measured speed is stored afterwards."""
    kind, begun, last = f"sweep {workload}", (0, 0.0), (0, 0.0)
    with bars(items, width=24, name="", digits=1, period=120) as shown:
        task = shown.add_task("sweep", total=None, start=False)

        def report(done: int, total: int) -> None:
            nonlocal begun, last
            last = (done, time.monotonic())
            if shown.tasks[0].total is None:
                begun = last
                line = estimate_text(kind, total - done)
                if line and total > done and not verbosity().quiet:
                    shown.console.print(line, style="dim")
                shown.reset(task, total=total, completed=done)
            else:
                shown.update(task, completed=done)

        yield report
    remember_speed(kind, last[0] - begun[0], last[1] - begun[1])


def _table(texts: Sequence[str], figures: Sequence[str]) -> Shown:
    """A table of E with columns of text and of figures."""
    banner(True)
    table = Shown(title="E = || |Gq| - p || / ||p||, in %", title_justify="left", box=None, pad_edge=False)
    for name in texts:
        table.add_column(name, no_wrap=True)
    for name in figures:
        table.add_column(name, justify="right")
    return table


def show_patterns(report: PatternReport) -> None:
    """Print a table of the conditions."""
    heads = ("strength", "height", "patterns", "mean", "sd", "median", "95 %", "worst", "rounded", "worst")
    table = _table((), heads)
    for row in report.conditions:
        where = (f"{row['strength']:g}", f"{row['height_mm']:g}mm", f"{row['patterns']}")
        shares = ("mean", "sd", "median", "p95", "worst", "mean_rounded", "worst_rounded")
        table.add_row(*where, *(f"{100 * row[name]:.2f}" for name in shares))
    out().print(table)
    out().print(report.words)


def show_trials(report: TrialReport) -> None:
    """Print a table of the trials."""
    table = _table(("recording", "variant"), ("frames", "strength", "mean", "95 %", "worst", "rounded", "worst"))
    shares = ("mean", "p95", "worst", "mean_rounded", "worst_rounded")
    for row in report.rows:
        figures = (f"{row['frames']}", f"{row['strength']:.3f}", *(f"{100 * row[name]:.2f}" for name in shares))
        table.add_row(row["recording"], row["variant"], *figures)
    console = out()
    console.print(table, width=max(console.width, 120), crop=False)
    out().print(report.words)
