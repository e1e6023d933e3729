"""A line that moves where a command works longer than two seconds without a bar of its own."""

from collections.abc import Generator
from contextlib import contextmanager
from threading import Timer

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

SILENT = 2.0
"""How long nothing need be seen, in s."""


class Waiting:
    """The line, which appears when it has to and goes with the first word of results.

    Parameters
    ----------
    words : str
        What goes on.
    console : Console
        Where; nothing is shown where nobody looks.
    after : float
        When it appears, in s.
    """

    def __init__(self, words: str, console: Console, *, after: float = SILENT) -> None:
        shown = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
        # Results go on to the output as they are: a live line would take them to the error stream.
        self._line = Progress(*shown, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
        self._line.add_task(words, total=None)
        self._timer = Timer(after, self._line.start)
        self._timer.daemon = True
        if console.is_terminal:
            self._timer.start()

    @property
    def seen(self) -> bool:
        """Whether it is there now."""
        return self._line.live.is_started

    def end(self) -> None:
        """Take it away; twice does no harm."""
        self._timer.cancel()
        if self._timer.is_alive():
            self._timer.join()
        if self.seen:
            self._line.stop()


@contextmanager
def waiting(words: str, console: Console) -> Generator[Waiting]:
    """Show it while inside."""
    line = Waiting(words, console)
    try:
        yield line
    finally:
        line.end()
