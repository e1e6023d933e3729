"""Progress reports of long computations and of loops."""

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar, runtime_checkable


@runtime_checkable
class Progress(Protocol):
    """Callback with the number of completed and of all frames, batches or tasks."""

    def __call__(self, done: int, total: int, /) -> None:
        """Report progress."""
        ...


T = TypeVar("T")


class _Watcher:
    """A progress callback, and whether a loop reports to it already; loops inside that one do not."""

    def __init__(self, report: Progress) -> None:
        self.report, self.busy = report, False


_watcher: ContextVar[_Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def report_to(report: Progress) -> Generator[None]:
    """Report each loop over `report_progress` to `report`; of nested loops only the outermost reports."""
    before = _watcher.set(_Watcher(report))
    try:
        yield
    finally:
        _watcher.reset(before)


def report_progress(items: Iterable[T], total: int, *, weight: Callable[[T], int] = lambda _: 1) -> Iterator[T]:
    """Yield the items and report progress to the callback of `report_to`, if any; `total` is the sum of the weights."""
    watcher = _watcher.get()
    if watcher is None or watcher.busy:
        yield from items
        return
    watcher.busy, done = True, 0
    try:
        for item in items:
            yield item
            done += weight(item)
            watcher.report(done, total)
    finally:
        watcher.busy = False
