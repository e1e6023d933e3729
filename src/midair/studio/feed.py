"""Frames on their way to the pages: as they come, and never more under way than a page draws.

A page gives back the number of messages that it drew; where it falls behind, its frames wait and are joined, so that a
slow page is late and never ever later.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.studio.studio_state import Page
from midair.view import Kind, counted, pack

LOOK = 0.05
"""Seconds after which is looked whether a page that was behind has room again, where nothing comes any more."""

KEPT = 60.0
"""Seconds of frames that wait for a page that is behind; the oldest are left out then, which it sees as a gap."""


class Feed:
    """Blocks of samples in, messages out.

    Parameters
    ----------
    pages : callable
        Gives the pages that look on now.
    """

    def __init__(self, pages: Callable[[], Iterable[Page]]) -> None:
        self._pages = pages
        self._blocks: deque[tuple[int, NDArray[np.float32]]] = deque()
        self._rate = 1000.0
        self._sent: dict[int, int] = {}
        self._numbers: dict[int, int] = {}
        self._task: asyncio.Task[None] | None = None
        self._fresh = asyncio.Event()
        self._end = 0
        self._run = 0

    def start(self, rate: float) -> None:
        """Frames of this rate will come, from 0 on."""
        self._rate = rate
        self._blocks.clear()
        self._sent.clear()
        self._end = 0
        if self._task is None:
            self._task = asyncio.ensure_future(self._go())

    def add(self, first: int, rows: NDArray[np.float32]) -> None:
        """Frames that were taken just now; a first one before the last is a sensor that was started anew."""
        if first < self._end:
            self._blocks.clear()
            self._sent.clear()
        self._blocks.append((first, rows))
        self._end = first + len(rows)
        self._fresh.set()
        while self._blocks and self._blocks[0][0] < self._end - KEPT * self._rate:
            self._blocks.popleft()

    def leave(self, page: Page) -> None:
        """A page is gone."""
        self._sent.pop(page.number, None)
        self._numbers.pop(page.number, None)

    def close(self) -> None:
        """Send no more."""
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _go(self) -> None:
        # The sensor's process gives 120 blocks a second. A clock of our own would beat against them, and against the
        # page's pictures.
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._fresh.wait(), LOOK)
            self._fresh.clear()
            for page in self._pages():
                with suppress(Exception):
                    await self._send(page)

    async def _send(self, page: Page) -> None:
        """What this page has not got yet, as one message, if it has credit."""
        if page.credit <= 0 or not self._blocks:
            return
        begin = self._sent.get(page.number, max(0, self._end - round(0.1 * self._rate)))
        if begin >= self._end:
            return
        parts: list[NDArray[np.float32]] = []
        first = -1
        for start, rows in self._blocks:
            if start + len(rows) <= begin:
                continue
            if first < 0:
                first = max(start, begin)
            elif start != first + sum(map(len, parts)):
                break  # lost frames: the rest goes with the next message, whose number tells the gap
            parts.append(rows[max(0, first - start) :] if not parts else rows)
        if not parts:
            return
        rows = np.concatenate(parts)
        self._sent[page.number] = first + len(rows)
        number = self._numbers[page.number] = self._numbers.get(page.number, 0) + 1
        page.credit -= 1
        section = counted(rows, Kind.SAMPLES, first=first, rate=self._rate)
        await page.wire.send_bytes(pack([_numbered(section, number)]))


def _numbered(section: Any, number: int) -> Any:
    from dataclasses import replace

    return replace(section, number=number)
