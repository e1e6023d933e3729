"""A bar that appears where a command works longer than two seconds without bars of its own."""

from collections.abc import Generator
from contextlib import contextmanager
from threading import Timer

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from midair.progress import watched

SILENT = 2.0
"""How long nothing need be seen, in s."""


class Waiting:
    """The bar, which appears when it has to and goes with the first word of results.

    Parameters
    ----------
    words : str
        What goes on.
    console : Console
        Where; nothing is shown where nobody looks.
    passes : int
        How often the command goes through what it works on, usually: time left is of all of them. Where there are more,
        the end moves on; where there are fewer, it comes earlier.
    after : float
        When it appears, in s.
    """

    def __init__(self, words: str, console: Console, *, passes: int = 1, after: float = SILENT) -> None:
        shown = (
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=16),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        # Results go on to the output as they are: a live line would take them to the error stream.
        self._line = Progress(*shown, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
        self._task = self._line.add_task(words, total=None)
        self._passes, self._gone = passes, 0
        self._timer = Timer(after, self._line.start)
        self._timer.daemon = True
        if console.is_terminal:
            self._timer.start()

    @property
    def share(self) -> float | None:
        """How much of all is done; None where nobody has said yet."""
        task = self._line.tasks[0]
        return None if task.total is None else task.completed / task.total

    @property
    def seen(self) -> bool:
        """Whether it is there now."""
        return self._line.live.is_started

    def report(self, done: int, total: int, /) -> None:
        """So far is one pass; each counts the same."""
        share = min(done / total, 1.0) if total else 1.0
        self._line.update(self._task, completed=self._gone + share, total=max(self._passes, self._gone + 1))
        self._gone += done >= total

    def end(self) -> None:
        """Take it away; twice does no harm."""
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self.seen:
            self._line.stop()


@contextmanager
def waiting(words: str, console: Console, *, passes: int = 1) -> Generator[Waiting]:
    """Show it while inside."""
    line = Waiting(words, console, passes=passes)
    try:
        with watched(line.report):
            yield line
    finally:
        line.end()
