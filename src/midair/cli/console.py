"""Console output of the commands: tables, JSON, verbosity (-q, -v), progress bars."""

import json
import shlex
import sys
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from textwrap import wrap
from threading import Timer
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from midair.model import Progress as Report


SILENT = 2.0
"""Delay before the elapsed time of a command appears, in s."""


_FLAGS = {"-q": "quiet", "-v": "verbose", "--verbose": "verbose", "-a": "all", "--all": "all"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verbosity:
    """Verbosity of a command."""

    quiet: bool = False
    """Neither progress bars nor meters; results, warnings and errors are still printed."""
    verbose: bool = False
    """Traceback for unexpected errors, and the run time at the end."""
    all: bool = False
    """All lines of a result; by default the main ones."""
    line: str = "midair"
    """The command line, quoted for a shell."""


_verbosity: ContextVar[Verbosity | None] = ContextVar("talk", default=None)


def verbosity() -> Verbosity:
    """Verbosity of the running command."""
    return _verbosity.get() or Verbosity()


@contextmanager
def with_verbosity(how: Verbosity) -> Generator[None]:
    """Set the verbosity inside the block."""
    before = _verbosity.set(how)
    try:
        yield
    finally:
        _verbosity.reset(before)


def parse_flags(tokens: Sequence[str]) -> tuple[Verbosity, list[str]]:
    """Verbosity flags of a command line before ``--``, and the command line without them."""
    ends = list(tokens).index("--") if "--" in tokens else len(tokens)
    said = {_FLAGS[token] for token in tokens[:ends] if token in _FLAGS}
    rest = [token for token in tokens[:ends] if token not in _FLAGS]
    rest += tokens[ends:]
    return Verbosity(line=shlex.join(["midair", *rest]), **dict.fromkeys(said, True)), rest


class PlainConsole(Console):
    """A console without markup, emoji codes and escape sequences, so that names cannot change the output."""

    def __init__(self, *, stderr: bool = False, markup: bool = False, soft_wrap: bool = False) -> None:
        super().__init__(stderr=stderr, markup=markup, emoji=False, highlight=False, soft_wrap=soft_wrap)

    def render_str(self, text: str, **how: Any) -> Text:
        """Every printed text, also in tables, passes through this method."""
        return super().render_str(_printable(text), **how)


class PerSecond(ProgressColumn):
    """Column with the speed of the work."""

    def __init__(self, items: str) -> None:
        super().__init__()
        self._items = items

    def render(self, task: Task) -> Text:
        """Items per second, once known."""
        # At the end the mean over the whole work: the last seconds may be a burst.
        speed = task.completed / task.finished_time if task.finished_time else task.speed
        return Text("" if speed is None else f"{speed:6.0f} {self._items}/s", style="cyan")


_waiting: ContextVar[Callable[[], None] | None] = ContextVar("waiting", default=None)


@contextmanager
def elapsed_time(words: str, *, after: float = SILENT) -> Generator[None]:
    """On a terminal, show the elapsed time inside the block from `after` seconds on, until the first output."""
    console = PlainConsole(stderr=True)
    if verbosity().quiet or not console.is_terminal:
        yield
        return
    shown = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    # Without redirection: Progress would send the results on stdout to the error stream.
    line = Progress(*shown, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    line.add_task(words, total=None)
    timer = Timer(after, line.start)
    timer.daemon = True

    def end() -> None:
        timer.cancel()
        if timer.is_alive():
            timer.join()
        if line.live.is_started:
            line.stop()

    before = _waiting.set(end)
    timer.start()
    try:
        yield
    finally:
        end()
        _waiting.reset(before)


def _end_waiting() -> None:
    """Remove the elapsed time before results or progress bars appear."""
    if (end := _waiting.get()) is not None:
        end()


def out() -> PlainConsole:
    """Console for results."""
    _end_waiting()
    return PlainConsole()


def err() -> PlainConsole:
    """Console for questions, progress and errors; only a terminal folds lines, so that programs read whole ones."""
    _end_waiting()
    return PlainConsole(stderr=True, soft_wrap=not sys.stderr.isatty())


def print_note(line: str, *, warn: bool = False) -> None:
    """Print a line on stderr, yellow for a warning."""
    err().print(line, style="yellow" if warn else None)


def confirmed(question: str) -> bool:
    """Whether a person at the terminal answers yes; without a terminal, no."""
    if not sys.stdin.isatty():
        return False
    err().print(f"{question} [y/N] ", end="")
    return sys.stdin.readline().strip().lower() in ("y", "yes")


@contextmanager
def progress_bars(items: str = "frames", *, period: float = 5) -> Generator[Callable[[str], "Report"]]:
    """Progress bars on stderr: done, total, speed over a period in s, time left; one for each stage."""
    shown = Progress(
        TextColumn("{task.description:<27}", markup=False),
        BarColumn(bar_width=16),
        MofNCompleteColumn(),
        PerSecond(items),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=err(),
        speed_estimate_period=period,
        disable=verbosity().quiet,
    )

    def begin(name: str, /) -> "Report":
        # Not before: the end of bars that were never shown is an empty line.
        shown.start()
        task = shown.add_task(_printable(name), total=None)

        def report(done: int, total: int) -> None:
            shown.update(task, completed=done, total=total)

        return report

    try:
        yield begin
        for task in shown.tasks:
            if task.total is None:
                shown.remove_task(task.id)
    finally:
        if shown.live.is_started:
            shown.stop()


def print_grid(heads: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "") -> None:
    """Print a table: a head for each column, and rows; columns of numbers end in line."""
    if title:
        out().print(title, style="bold")
    table, lines = Table(box=None, pad_edge=False), list(rows)
    for number, name in enumerate(heads):
        cells = [row[number].lstrip("+-.") for row in lines]
        figures = number > 0 and all(cell in ("", "none") or cell[0].isdigit() for cell in cells)
        table.add_column(name, justify="right" if figures else "left", overflow="fold")
    for row in lines:
        table.add_row(*row)
    with (console := out()).capture() as shown:
        console.print(table)
    # Without the spaces that fill the last column.
    print("\n".join(line.rstrip() for line in shown.get().splitlines()))  # noqa: T201


def print_answer(text: str, *, simulated: bool) -> None:
    """Print the first line of a result, with a mark before a simulated one."""
    console, mark = out(), "SIMULATED  " if simulated else ""
    shown = Text("\n".join(wrap(mark + _printable(text), console.width, break_on_hyphens=False)), style="bold")
    shown.stylize("red", 0, len(mark))
    console.print(shown, soft_wrap=True)


def print_rows(rows: Iterable[tuple[str, str]]) -> None:
    """Print names and values, one pair per line; long values are wrapped, after a long name on a line of their own."""
    console, shown = out(), [(_printable(name), _printable(value)) for name, value in rows]
    column = min(max((len(name) for name, _ in shown), default=0), 24) + 2
    for name, value in shown:
        lines = wrap(value, max(console.width - column, 20), break_on_hyphens=False)
        begin = f"{name:{column}}" if len(name) < column else name + "\n" + " " * column
        console.print(Text.assemble((begin, "bold"), f"\n{' ' * column}".join(lines)), soft_wrap=True)


def print_json(value: object) -> None:
    """Print one JSON document; NaN and infinity become null."""
    from midair.files import for_json

    _end_waiting()
    print(json.dumps(for_json(value), indent=2, default=str))  # noqa: T201


def _printable(text: str) -> str:
    """`midair.files.printable`, imported late because it needs NumPy and HDF5."""
    from midair.files import printable

    return printable(text)


def banner(simulated: bool) -> None:
    """Print a warning if the results are simulated."""
    if simulated:
        err().print("SIMULATED: no sensor, array or skin was involved", style="bold red")


def warn_simulated(mark: str) -> None:
    """Print the mark of simulated answers, if there is one."""
    if mark:
        err().print(mark, style="bold red")
