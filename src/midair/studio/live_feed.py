"""Packed sections of live touch for the pages, with flow control.

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
class _Looking:
    page: Page
    next: int
    fresh: asyncio.Event = field(default_factory=asyncio.Event)
    task: "asyncio.Task[None] | None" = None
    messages: "itertools.count[int]" = field(default_factory=lambda: itertools.count(1))


class LiveFeed:
    """Sends packed sections to the pages."""

    def __init__(self) -> None:
        self._blocks: deque[list[bytes]] = deque()
        self._first = 0
        self._looking: dict[int, _Looking] = {}
        self._most = round(KEPT * 120)

    @property
    def waiting(self) -> int:
        """Number of blocks that some page has not received yet."""
        return len(self._blocks)

    def enter(self, page: Page) -> None:
        """Send to this page from now on."""
        self.leave(page)
        looking = self._looking[page.number] = _Looking(page, self._first + len(self._blocks))
        looking.task = asyncio.ensure_future(self._go(looking))

    def leave(self, page: Page) -> None:
        """Stop sending to a page."""
        looking = self._looking.pop(page.number, None)
        if looking is not None and looking.task is not None:
            looking.task.cancel()
        self._forget()

    def add(self, sections: list[bytes]) -> None:
        """Append the next sections."""
        self._blocks.append(sections)
        self._forget()
        for looking in self._looking.values():
            looking.fresh.set()

    def remind(self, page: Page) -> None:
        """Send waiting sections to a page that may have returned credit."""
        if page.number in self._looking:
            self._looking[page.number].fresh.set()

    def close(self) -> None:
        """Stop sending."""
        for looking in list(self._looking.values()):
            self.leave(looking.page)

    def _forget(self) -> None:
        """Drop the blocks that every page has received and those that are too old."""
        end = self._first + len(self._blocks)
        wanted = max(min((each.next for each in self._looking.values()), default=end), end - self._most)
        while self._first < wanted:
            self._blocks.popleft()
            self._first += 1

    async def _go(self, looking: _Looking) -> None:
        # A closed socket is handled where it is read; that code calls `leave`.
        with suppress(Exception):
            while True:
                await looking.fresh.wait()
                looking.fresh.clear()
                begin = max(looking.next, self._first)
                end = self._first + len(self._blocks)
                if looking.page.credit <= 0 or begin >= end:
                    continue
                blocks = list(itertools.islice(self._blocks, begin - self._first, None))
                looking.next = end
                looking.page.credit -= 1
                self._forget()
                await looking.page.wire.send_bytes(numbered(blocks, next(looking.messages)))


def numbered(blocks: list[list[bytes]], number: int) -> bytes:
    """Join the sections of some blocks, each with the message number in bytes 4 to 8 of its header."""
    header = (number % 2**32).to_bytes(4, "little")
    return b"".join(section[:4] + header + section[8:] for block in blocks for section in block)
