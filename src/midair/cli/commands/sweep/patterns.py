"""Commands for sweeps: many patterns on many processes, and what came out."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter, Token
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table as Shown
from rich.text import Text

from midair.cli.terminal.console import banner, out
from midair.cli.terminal.quantity import parse_quantity, spell
from midair.model import Medium
from midair.physics import Directivity
from midair.solvers import Progress as Advance
from midair.sweep.pattern_report import PatternResults, Report, report_of
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.run import run_sweep
from midair.sweep.store import load_sweep
from midair.sweep.task import Sweep

app = App(
    name="sweep",
    help="Solve many targets on many processes, and report E: all binary patterns of the paper's simulation (5.1) over "
    "strengths and heights, or recordings under many settings.",
)


def _lengths(_: Any, tokens: Sequence[Token]) -> tuple[float, ...]:
    return tuple(parse_quantity(token.value, "m") for token in tokens)


def _spelt(values: tuple[float, ...]) -> str:
    return " ".join(spell(value, "m") for value in values)


Numbers = Annotated[tuple[float, ...], Parameter(consume_multiple=True)]
Lengths = Annotated[
    tuple[float, ...],
    Parameter(converter=_lengths, n_tokens=-1, consume_multiple=True, show_default=_spelt, metavar="QUANTITIES"),
]


class PerSecond(ProgressColumn):
    """How fast the work goes."""

    def __init__(self, items: str) -> None:
        super().__init__()
        self._items = items

    def render(self, task: Task) -> Text:
        """Items per second, once there is something to tell."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:6.1f} {self._items}/s", style="cyan")


@app.command(name="patterns")
def patterns_command(
    output: Path,
    /,
    *,
    strength: Numbers = (0.1, 0.2),
    height: Lengths = (0.2,),
    count: int = 65535,
    curve_strength: Numbers = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4),
    curve_height: Lengths = (0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3),
    curves: int = 512,
    seed: int = 2024,
    method: str = "fast",
    iterations: int | None = None,
    directivity: Directivity = "point",
    attenuation: float = 0.0,
    bits: int = 8,
    chunk: int = 512,
    scheduler: str | None = None,
    workers: int | None = None,
) -> int:
    """Solve binary 4 x 4 patterns at each strength and height; go on where it was interrupted.

    The paper's experiment 5.1: all 65535 patterns, point sources, no attenuation. Results go into a Zarr group as they
    come. Stopped or killed, the same command goes on without doing anything twice.

    Parameters
    ----------
    output
        NAME.zarr, new or of the same sweep.
    strength
        Peak of the target over the focus of the whole array.
    height
        Of the control points above the array.
    count
        How many patterns, drawn with the seed; 65535 is all.
    curve_strength
        Strengths of the curve of E over strength, at the first height.
    curve_height
        Heights of the curves of E over height, at each strength.
    curves
        How many patterns are behind the curves; 0 for no curves.
    seed
        Of the order of the patterns.
    method
        The solver, as in midair solve.
    iterations
        Of the solver; its own if not given.
    directivity
        Of a transducer.
    attenuation
        Of the air, in Np/m.
    bits
        To which phases are rounded for the second E.
    chunk
        Patterns a task: what a kill may cost each process.
    scheduler
        Address of a Dask scheduler, such as tcp://host:8786; processes on this machine if not given.
    workers
        Processes on this machine; one a core if not given.
    """
    sweep = PatternSweep(
        strengths=strength,
        heights=height,
        count=count,
        curve_strengths=curve_strength,
        curve_heights=curve_height,
        curve_count=curves,
        seed=seed,
        method=method,
        iterations=iterations,
        directivity=directivity,
        medium=Medium(attenuation=attenuation),
        bits=bits,
        chunk=chunk,
    )
    status = swept(sweep, output, scheduler=scheduler, workers=workers)
    if status == 0:
        show_patterns(report_of(PatternResults.of(load_sweep(output))))
        out().print(f"Next: midair sweep report {output}", markup=False)
    return status


def swept(sweep: Sweep, path: Path, *, scheduler: str | None, workers: int | None) -> int:
    """Run a sweep with a progress bar; its exit status."""
    try:
        with sweep_bar(f"{sweep.item}s") as progress:
            run_sweep(sweep, path, scheduler=scheduler, workers=workers, progress=progress)
    except KeyboardInterrupt:
        _say("stopped; what was solved is stored, and the same command goes on")
        return 130
    return 0


@contextmanager
def sweep_bar(items: str) -> Generator[Advance]:
    """A progress bar on the error stream: patterns or frames, how many per second, time left."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        PerSecond(items),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=Console(stderr=True), speed_estimate_period=120) as bars:
        task = bars.add_task("sweep", total=None, start=False)

        def report(done: int, total: int) -> None:
            if bars.tasks[0].total is None:
                bars.reset(task, total=total, completed=done)
            else:
                bars.update(task, completed=done)

        yield report


def _say(words: str) -> None:
    Console(stderr=True, highlight=False, soft_wrap=True).print(f"midair: {words}", markup=False)


def show_patterns(report: Report) -> None:
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
    out().print(report.words, markup=False)
