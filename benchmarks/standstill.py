"""When the computer itself stood still: a thread that comes before all others and only sleeps, on each core.

What it is not woken for, no program could have run through: the host of a virtual machine, or its firmware. So it tells
frames that a loop is late with from those that nobody could have had in time.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time
from multiprocessing.connection import Connection

import numpy as np

NAP, HIGHEST = 1e-3, 90
"""How long it sleeps at a time, in s, and its priority: above a live loop's, below the kernel's own threads."""


class Standstills:
    """Watches from its making on.

    Attributes
    ----------
    granted : bool
        Whether it got its priority; without it, it sees other programs, too, and tells nothing.
    """

    def __init__(self) -> None:
        self._watchers: list[tuple[multiprocessing.Process, Connection]] = []
        for core in sorted(os.sched_getaffinity(0)):
            ours, theirs = multiprocessing.Pipe()
            process = multiprocessing.Process(target=_watch, args=(core, theirs), daemon=True)
            process.start()
            self._watchers.append((process, ours))
        self.granted = all(ours.recv() for _, ours in self._watchers)

    def end(self, longer: float = 2e-3) -> list[np.ndarray]:
        """Of each core, (begin, end) by `time.monotonic` of what lasted longer, in s, shape (standstill, 2)."""
        found = []
        for process, ours in self._watchers:
            ours.send(None)
            seen = ours.recv()
            process.join()
            found.append(seen[seen[:, 1] - seen[:, 0] > longer])
        return found


def _watch(core: int, theirs: Connection) -> None:
    os.sched_setaffinity(0, {core})
    granted = False
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(HIGHEST))
        granted = True
    theirs.send(granted)
    seen = []
    before = time.monotonic()
    while not theirs.poll():
        time.sleep(NAP)
        now = time.monotonic()
        if now - before > 1.5 * NAP:
            # It was to wake a nap after `before`.
            seen.append((before + NAP, now))
        before = now
    theirs.send(np.array(seen).reshape(-1, 2))


def beside(moments: np.ndarray, stills: list[np.ndarray], *, before: float, after: float) -> np.ndarray:
    """Which moments lie in a standstill of any core, or so long before or after it, shape (moment,); all in s."""
    hit = np.zeros(len(moments), bool)
    for begin, end in np.concatenate(stills):
        hit |= (moments >= begin - before) & (moments <= end + after)
    return hit
