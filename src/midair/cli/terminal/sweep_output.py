"""What commands of sweeps show: a bar while one runs, a table of what came out."""

from collections.abc import Generator
from contextlib import contextmanager

from rich.table import Table as Shown

from midair.cli.terminal.console import banner, bars, err, out
from midair.errors import InputError
from midair.model import Progress as Advance
from midair.sweep import PatternReport, Sweep, TrialReport, run_sweep


def swept(sweep: Sweep, where: str, *, scheduler: str | None, workers: int | None) -> int:
    """Run a sweep with a progress bar; its exit status."""
    if not where.rstrip("/").endswith(".zarr"):
        raise InputError(f"{where}: expected a name that ends in .zarr for a sweep")
    try:
        with sweep_bar("patterns" if sweep.kind == "patterns" else "frames") as progress:
            run_sweep(sweep, where, scheduler=scheduler, workers=workers, progress=progress)
    except KeyboardInterrupt:
        _say("stopped; what was solved is stored, and the same command goes on")
        return 130
    return 0


@contextmanager
def sweep_bar(items: str) -> Generator[Advance]:
    """A progress bar on the error stream: patterns or frames, how many per second, time left."""
    with bars(items, width=24, name="", digits=1, period=120) as shown:
        task = shown.add_task("sweep", total=None, start=False)

        def report(done: int, total: int) -> None:
            if shown.tasks[0].total is None:
                shown.reset(task, total=total, completed=done)
            else:
                shown.update(task, completed=done)

        yield report


def _say(words: str) -> None:
    err().print(f"midair: {words}")


def show_patterns(report: PatternReport) -> None:
    """A table of conditions."""
    banner(True)
    table = Shown(title="E = || |Gq| - p || / ||p||, in %", title_justify="left", box=None, pad_edge=False)
    for name in ("strength", "height", "patterns", "mean", "sd", "median", "95 %", "worst", "rounded", "worst"):
        table.add_column(name, justify="right")
    for row in report.conditions:
        where = (f"{row['strength']:g}", f"{row['height_mm']:g}mm", f"{row['patterns']}")
        shares = ("mean", "sd", "median", "p95", "worst", "mean_rounded", "worst_rounded")
        table.add_row(*where, *(f"{100 * row[name]:.2f}" for name in shares))
    out().print(table)
    out().print(report.words)


def show_trials(report: TrialReport) -> None:
    """A table of trials."""
    banner(True)
    table = Shown(title="E = || |Gq| - p || / ||p||, in %", title_justify="left", box=None, pad_edge=False)
    for name in ("recording", "variant"):
        table.add_column(name, no_wrap=True)
    for name in ("frames", "strength", "mean", "95 %", "worst", "rounded", "worst"):
        table.add_column(name, justify="right")
    shares = ("mean", "p95", "worst", "mean_rounded", "worst_rounded")
    for row in report.rows:
        figures = (f"{row['frames']}", f"{row['strength']:.3f}", *(f"{100 * row[name]:.2f}" for name in shares))
        table.add_row(row["recording"], row["variant"], *figures)
    console = out()
    console.print(table, width=max(console.width, 120), crop=False)
    out().print(report.words)
