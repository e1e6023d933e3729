"""What long work calls as it goes on, and how far the loops of short work are, for whoever watches."""

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar


class Progress(Protocol):
    """Called with how much is done, and how much there is in all: frames, batches or tasks."""

    def __call__(self, done: int, total: int, /) -> None:
        """Done, and in all."""
        ...


T = TypeVar("T")


class _Watcher:
    """Who watches, and whether a loop reports already: those inside it do not."""

    def __init__(self, report: Progress) -> None:
        self.report, self.busy = report, False


_watcher: ContextVar[_Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched(report: Progress) -> Generator[None]:
    """Tell `report` how far each loop of `passing` inside is, the outermost of those that run at the same time."""
    before = _watcher.set(_Watcher(report))
    try:
        yield
    finally:
        _watcher.reset(before)


def passing(items: Iterable[T], total: int, *, weight: Callable[[T], int] = lambda _: 1) -> Iterator[T]:
    """The items as they are; whoever watches is told how far the loop over them is.

    Parameters
    ----------
    items : iterable
        To go through.
    total : int
        What all of them weigh together.
    weight : callable
        Of an item; 1 each if not given.
    """
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
