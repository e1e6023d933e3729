"""Frames of a sensor for the pages, with flow control.

A page returns credit for each message that it drew. Frames for a slow page wait and are joined into one message, so
that its delay does not grow.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.studio.studio_state import Page
from midair.view import Kind, encode_counts, pack

LOOK = 0.05
"""Seconds between two checks for new credit while no frames arrive."""

KEPT = 60.0
"""Seconds of frames that wait for a slow page; older ones are dropped, and the page shows a gap."""


class Feed:
    """Sends blocks of samples as binary messages to the pages that `pages()` returns."""

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
        """Start at frame 0 with this rate in Hz."""
        self._rate = rate
        self._blocks.clear()
        self._sent.clear()
        self._end = 0
        if self._task is None:
            self._task = asyncio.ensure_future(self._go())

    def add(self, first: int, rows: NDArray[np.float32]) -> None:
        """Append new frames; a number below the last one means that the sensor was restarted."""
        if first < self._end:
            self._blocks.clear()
            self._sent.clear()
        self._blocks.append((first, rows))
        self._end = first + len(rows)
        self._fresh.set()
        while self._blocks and self._blocks[0][0] < self._end - KEPT * self._rate:
            self._blocks.popleft()

    def leave(self, page: Page) -> None:
        """Forget a page that has gone."""
        self._sent.pop(page.number, None)
        self._numbers.pop(page.number, None)

    def close(self) -> None:
        """Stop sending."""
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _go(self) -> None:
        # The sensor process sends 120 blocks/s. A second clock would beat against them and the page's frame rate.
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._fresh.wait(), LOOK)
            self._fresh.clear()
            for page in self._pages():
                with suppress(Exception):
                    await self._send(page)

    async def _send(self, page: Page) -> None:
        """Send the page's missing frames as one message, if it has credit."""
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
                break  # lost frames: the rest is sent with the next message, whose frame number shows the gap
            parts.append(rows[max(0, first - start) :] if not parts else rows)
        if not parts:
            return
        rows = np.concatenate(parts)
        self._sent[page.number] = first + len(rows)
        number = self._numbers[page.number] = self._numbers.get(page.number, 0) + 1
        page.credit -= 1
        section = encode_counts(rows, Kind.SAMPLES, first=first, rate=self._rate)
        await page.wire.send_bytes(pack([_numbered(section, number)]))


def _numbered(section: Any, number: int) -> Any:
    from dataclasses import replace

    return replace(section, number=number)
