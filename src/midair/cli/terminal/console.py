"""What the commands print: tables, progress, and JSON for programs."""

import json
import math
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from midair.model import Progress as Report
from midair.rig import Stage


class FramesPerSecond(ProgressColumn):
    """How fast the work goes."""

    def render(self, task: Task) -> Text:
        """Frames per second, once there is something to tell."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:6.0f} frames/s", style="cyan")


def out() -> Console:
    """Where results go."""
    return Console(highlight=False, soft_wrap=True)


def say(line: str) -> None:
    """A line of results."""
    out().print(line, markup=False)


@contextmanager
def stages() -> Generator[Stage]:
    """A progress bar on the error stream with a line for each stage: frames, frames per second, time left."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:<27}"),
        BarColumn(bar_width=16),
        MofNCompleteColumn(),
        FramesPerSecond(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=console, speed_estimate_period=5) as bars:

        def begin(name: str) -> Report:
            task = bars.add_task(name, total=None)

            def report(done: int, total: int) -> None:
                bars.update(task, completed=done, total=total)

            return report

        yield begin
        for task in bars.tasks:
            if task.total is None:
                bars.remove_task(task.id)


def print_figures(title: str, columns: Mapping[str, Mapping[str, tuple[float, str]]]) -> None:
    """A table of figures: a row each, a column for each thing that has them, and the unit."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    for name in columns:
        table.add_column(name, justify="right")
    table.add_column("unit")
    first = next(iter(columns.values()))
    for name, (_, unit) in first.items():
        table.add_row(name, *(f"{column[name][0]:.4g}" for column in columns.values()), unit)
    out().print(table)


def print_rows(rows: Iterable[tuple[str, str]]) -> None:
    """Names and values below each other."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, value)
    out().print(table)


def print_json(value: object) -> None:
    """One JSON document on the output; NaN and infinity, which JSON lacks, become null."""
    print(json.dumps(_finite(value), indent=2, default=str))  # noqa: T201


def banner(simulated: bool) -> None:
    """Say so when what follows is simulated."""
    if simulated:
        Console(stderr=True).print("SIMULATED: no sensor, array or skin was involved", style="bold red")


def _finite(value: object) -> object:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value
