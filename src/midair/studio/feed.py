"""Packed sections of a sensor or of live touch for the pages, with flow control.

A page returns credit for each message that it drew. Sections for a slow page wait and are joined into one message, so
that its delay does not grow and no page waits for another.
"""

import asyncio
import itertools
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field

from midair.studio.studio_state import Page

KEPT = 60.0
"""Seconds of sections that wait for a slow page; older ones are dropped, and the page shows a gap."""


@dataclass(slots=True, eq=False)
class _Viewer:
    page: Page
    next: int
    fresh: asyncio.Event = field(default_factory=asyncio.Event)
    task: "asyncio.Task[None] | None" = None
    messages: "itertools.count[int]" = field(default_factory=lambda: itertools.count(1))


class Feed:
    """Sends packed sections to the pages."""

    def __init__(self) -> None:
        self._blocks: deque[list[bytes]] = deque()
        self._first = 0
        self._viewers: dict[int, _Viewer] = {}
        self._most = round(KEPT * 120)

    @property
    def waiting(self) -> int:
        """Number of blocks that some page has not received yet."""
        return len(self._blocks)

    def enter(self, page: Page) -> None:
        """Send to this page from now on."""
        self.leave(page)
        viewer = self._viewers[page.number] = _Viewer(page, self._first + len(self._blocks))
        viewer.task = asyncio.ensure_future(self._go(viewer))

    def leave(self, page: Page) -> None:
        """Stop sending to a page."""
        viewer = self._viewers.pop(page.number, None)
        if viewer is not None and viewer.task is not None:
            viewer.task.cancel()
        self._forget()

    def add(self, sections: list[bytes]) -> None:
        """Append the next sections."""
        self._blocks.append(sections)
        self._forget()
        for viewer in self._viewers.values():
            viewer.fresh.set()

    def remind(self, page: Page) -> None:
        """Send waiting sections to a page that may have returned credit."""
        if page.number in self._viewers:
            self._viewers[page.number].fresh.set()

    def close(self) -> None:
        """Stop sending."""
        for viewer in list(self._viewers.values()):
            self.leave(viewer.page)

    def _forget(self) -> None:
        """Drop the blocks that every page has received and those that are too old."""
        end = self._first + len(self._blocks)
        wanted = max(min((each.next for each in self._viewers.values()), default=end), end - self._most)
        while self._first < wanted:
            self._blocks.popleft()
            self._first += 1

    async def _go(self, viewer: _Viewer) -> None:
        # A closed socket is handled where it is read; that code calls `leave`.
        with suppress(Exception):
            while True:
                await viewer.fresh.wait()
                viewer.fresh.clear()
                begin = max(viewer.next, self._first)
                end = self._first + len(self._blocks)
                if viewer.page.credit <= 0 or begin >= end:
                    continue
                blocks = list(itertools.islice(self._blocks, begin - self._first, None))
                viewer.next = end
                viewer.page.credit -= 1
                self._forget()
                await viewer.page.wire.send_bytes(numbered(blocks, next(viewer.messages)))


def numbered(blocks: list[list[bytes]], number: int) -> bytes:
    """Join the sections of some blocks, each with the message number in bytes 4 to 8 of its header."""
    header = (number % 2**32).to_bytes(4, "little")
    return b"".join(section[:4] + header + section[8:] for block in blocks for section in block)
