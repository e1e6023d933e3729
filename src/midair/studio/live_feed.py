"""Sections on their way to the pages as they come, never more under way than a page draws.

A page gives back the number of messages that it drew; where it falls behind, its sections wait and go as one message,
so that a slow page is late and never ever later, and no page waits for another.
"""

import asyncio
import itertools
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field

from midair.studio.studio_state import Page

KEPT = 60.0
"""Seconds of sections that wait for a page that is behind; the oldest are left out then, which it sees as a gap."""


@dataclass(slots=True, eq=False)
class _Looking:
    page: Page
    next: int
    fresh: asyncio.Event = field(default_factory=asyncio.Event)
    task: "asyncio.Task[None] | None" = None
    messages: "itertools.count[int]" = field(default_factory=lambda: itertools.count(1))


class LiveFeed:
    """Packed sections in, messages out."""

    def __init__(self) -> None:
        self._blocks: deque[list[bytes]] = deque()
        self._first = 0
        self._looking: dict[int, _Looking] = {}
        self._most = round(KEPT * 120)

    @property
    def waiting(self) -> int:
        """Blocks that some page has not got yet."""
        return len(self._blocks)

    def enter(self, page: Page) -> None:
        """A page looks on from now on."""
        self.leave(page)
        looking = self._looking[page.number] = _Looking(page, self._first + len(self._blocks))
        looking.task = asyncio.ensure_future(self._go(looking))

    def leave(self, page: Page) -> None:
        """A page is gone, or looks elsewhere."""
        looking = self._looking.pop(page.number, None)
        if looking is not None and looking.task is not None:
            looking.task.cancel()
        self._forget()

    def add(self, sections: list[bytes]) -> None:
        """Sections that follow those before."""
        self._blocks.append(sections)
        self._forget()
        for looking in self._looking.values():
            looking.fresh.set()

    def remind(self, page: Page) -> None:
        """A page was heard: it may have room for what waits."""
        if page.number in self._looking:
            self._looking[page.number].fresh.set()

    def close(self) -> None:
        """Send no more."""
        for looking in list(self._looking.values()):
            self.leave(looking.page)

    def _forget(self) -> None:
        """What every page has got, and what is too old."""
        end = self._first + len(self._blocks)
        wanted = max(min((each.next for each in self._looking.values()), default=end), end - self._most)
        while self._first < wanted:
            self._blocks.popleft()
            self._first += 1

    async def _go(self, looking: _Looking) -> None:
        # A page that hangs up is told to leave by whoever hears of it.
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
    """All sections of some blocks as one message, each with the message's number (bytes 4 to 8 of its header)."""
    told = (number % 2**32).to_bytes(4, "little")
    return b"".join(section[:4] + told + section[8:] for block in blocks for section in block)
