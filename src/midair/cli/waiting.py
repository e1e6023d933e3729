"""A progress bar that appears when a command without its own bars runs for more than two seconds."""

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

from midair.progress import report_to

SILENT = 2.0
"""Delay before the bar appears, in s."""


class BusyBar:
    """A progress bar over an expected number of passes; it appears after `after` seconds and ends with the first
    output.
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
        # Without redirection: Progress would send the results on stdout to the error stream.
        self._line = Progress(*shown, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
        self._task = self._line.add_task(words, total=None)
        self._passes, self._finished = passes, 0
        self._timer = Timer(after, self._line.start)
        self._timer.daemon = True
        if console.is_terminal:
            self._timer.start()

    @property
    def share(self) -> float | None:
        """Fraction done; None before the first report."""
        task = self._line.tasks[0]
        return None if task.total is None else task.completed / task.total

    @property
    def visible(self) -> bool:
        """Whether the bar is on the screen."""
        return self._line.live.is_started

    def report(self, done: int, total: int, /) -> None:
        """Progress within one pass; each pass counts the same."""
        share = min(done / total, 1.0) if total else 1.0
        self._line.update(self._task, completed=self._finished + share, total=max(self._passes, self._finished + 1))
        self._finished += done >= total

    def end(self) -> None:
        """Remove the bar; repeated calls are allowed."""
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self.visible:
            self._line.stop()


@contextmanager
def waiting(words: str, console: Console, *, passes: int = 1) -> Generator[BusyBar]:
    """Show the bar inside the block."""
    line = BusyBar(words, console, passes=passes)
    try:
        with report_to(line.report):
            yield line
    finally:
        line.end()
