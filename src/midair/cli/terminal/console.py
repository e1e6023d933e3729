"""What the commands print: tables, progress, and JSON for programs; and how much of it (-q, -v)."""

import json
import shlex
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from midair.cli.speeds import MEASURED, Speeds, Work, estimate_text
from midair.cli.waiting import Waiting, waiting

if TYPE_CHECKING:
    from midair.model import Progress as Report

_FLAGS = {"-q": "quiet", "-v": "verbose", "--verbose": "verbose"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verbosity:
    """How much is said.

    Parameters
    ----------
    quiet : bool
        Neither bars nor meters. Results, warnings and errors are said all the same.
    verbose : bool
        An error that nobody foresaw comes with its traceback; at the end, the time that it took.
    line : str
        What was typed, as a shell takes it again.
    """

    quiet: bool = False
    verbose: bool = False
    line: str = "midair"


_talk: ContextVar[Verbosity | None] = ContextVar("talk", default=None)


def verbosity() -> Verbosity:
    """How much the command that runs is to say."""
    return _talk.get() or Verbosity()


@contextmanager
def with_verbosity(how: Verbosity) -> Generator[None]:
    """Say so much inside."""
    before = _talk.set(how)
    try:
        yield
    finally:
        _talk.reset(before)


def flags_of(tokens: Sequence[str]) -> tuple[Verbosity, list[str]]:
    """What a command line says of it, wherever it stands before ``--``, and the command line without."""
    ends = list(tokens).index("--") if "--" in tokens else len(tokens)
    said = {_FLAGS[token] for token in tokens[:ends] if token in _FLAGS}
    rest = [token for token in tokens[:ends] if token not in _FLAGS]
    rest += tokens[ends:]
    return Verbosity(quiet="quiet" in said, verbose="verbose" in said, line=shlex.join(["midair", *rest])), rest


class PlainConsole(Console):
    """A console on which text is text: no markup, no emoji codes, no escape sequences, whoever wrote it.

    Names of files, notes in them and names of devices are printed everywhere: that they do nothing is decided here,
    once. Styles are given beside the text, or as `rich.text.Text`, whose content goes through `printable` first.
    """

    def __init__(self, *, stderr: bool = False, markup: bool = False, soft_wrap: bool = True) -> None:
        super().__init__(stderr=stderr, markup=markup, emoji=False, highlight=False, soft_wrap=soft_wrap)

    def render_str(self, text: str, **how: Any) -> Text:
        """Every text that is printed, also in tables, comes through here."""
        return super().render_str(_printable(text), **how)


class PerSecond(ProgressColumn):
    """How fast the work goes."""

    def __init__(self, items: str, digits: int) -> None:
        super().__init__()
        self._items, self._digits = items, digits

    def render(self, task: Task) -> Text:
        """Items per second, once there is something to tell."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:6.{self._digits}f} {self._items}/s", style="cyan")


def bars(items: str = "frames", *, width: int = 16, name: str = "<27", digits: int = 0, period: float = 5) -> Progress:
    """Progress bars on the error stream: what is done, how many, how many a second, time left."""
    return Progress(
        TextColumn(f"{{task.description:{name}}}", markup=False),
        BarColumn(bar_width=width),
        MofNCompleteColumn(),
        PerSecond(items, digits),
        TimeRemainingColumn(elapsed_when_finished=True),
        console=err(),
        speed_estimate_period=period,
        disable=verbosity().quiet,
    )


_waiting: ContextVar[Waiting | None] = ContextVar("waiting", default=None)


@contextmanager
def busy_bar(words: str, passes: int) -> Generator[None]:
    """A bar after two seconds inside, until results come; nothing with -q."""
    if verbosity().quiet:
        yield
        return
    with waiting(words, PlainConsole(stderr=True), passes=passes) as line:
        before = _waiting.set(line)
        try:
            yield
        finally:
            _waiting.reset(before)


def _no_longer_waiting() -> None:
    """Results come, or other bars: this one makes room."""
    line = _waiting.get()
    if line is not None:
        line.end()


def out() -> PlainConsole:
    """Where results go."""
    _no_longer_waiting()
    return PlainConsole()


def err() -> PlainConsole:
    """Where everything else goes: questions, progress, errors."""
    _no_longer_waiting()
    return PlainConsole(stderr=True)


def say(line: str) -> None:
    """A line of results."""
    out().print(line)


class ProgressBars(Protocol):
    """Told the name of each stage as it begins, and what it works on; gives the progress to report to."""

    def __call__(self, name: str, /, workload: str = "") -> "Report":
        """The progress of this stage."""
        ...


def work_of(name: str, workload: str, frames: int) -> Work:
    """So many frames of a stage: its name up to the first comma and what it works on decide how fast they go."""
    return Work(kind=f"{name.partition(',')[0]} {workload}".strip(), frames=frames)


@contextmanager
def progress_bars(works: Sequence[Work] = ()) -> Generator[ProgressBars]:
    """A progress bar on the error stream with a line for each stage: frames, frames per second, time left.

    Before it, how long these works will take; after it, what was learnt of how fast they go here.
    """
    speeds, running = Speeds.known(), list[_Running]()
    if works and (line := estimate_text(speeds, works)) and not verbosity().quiet:
        err().print(line, style="dim")
    with bars() as shown:

        def begin(name: str, /, workload: str = "") -> "Report":
            task = shown.add_task(_printable(name), total=None)
            if running:
                running[-1].ended = time.monotonic()
            running.append(stage := _Running(name=name, workload=workload))

            def report(done: int, total: int) -> None:
                stage.done = done
                shown.update(task, completed=done, total=total)

            return report

        yield begin
        for task in shown.tasks:
            if task.total is None:
                shown.remove_task(task.id)
    for stage in running:
        took = (stage.ended or time.monotonic()) - stage.began
        if stage.done and took >= MEASURED:
            speeds = speeds.learnt(work_of(stage.name, stage.workload, stage.done), took)
    if running:
        speeds.keep()


@dataclass(slots=True, kw_only=True)
class _Running:
    """A stage at work, and how far it is."""

    name: str
    workload: str
    began: float = field(default_factory=time.monotonic)
    ended: float = 0.0
    done: int = 0


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
    from midair.files import for_json

    _no_longer_waiting()
    print(json.dumps(for_json(value), indent=2, default=str))  # noqa: T201


def _printable(text: str) -> str:
    """As `midair.files` has it, which takes NumPy and HDF5 with it: help prints without."""
    from midair.files import printable

    return printable(text)


def banner(simulated: bool) -> None:
    """Say so when what follows is simulated."""
    if simulated:
        err().print("SIMULATED: no sensor, array or skin was involved", style="bold red")


def warn_simulated(simulated: bool) -> None:
    """Say so when nobody answered what follows."""
    if simulated:
        err().print("SIMULATED: no person was asked", style="bold red")
