"""Detect when the computer itself stopped, with a sleeping thread of the highest priority on each core.

If this thread is not woken in time, no program could run, because of the host of a virtual machine or the firmware.
This separates frames that a loop delayed from frames that were impossible to send in time.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time
from multiprocessing.connection import Connection

import numpy as np

NAP, HIGHEST = 1e-3, 90
"""Sleep interval in s, and priority: above that of a live loop, below the kernel's own threads."""


class Standstills:
    """Monitor for stops of the computer, from its creation on.

    If `granted` is False, there is no real-time priority, and other programs also cause detections, so the result is
    invalid.
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
        """Return (begin, end) in s by `time.monotonic` of all stops of at least `longer`, one array for each core."""
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
            # It should have been woken one interval after `before`.
            seen.append((before + NAP, now))
        before = now
    theirs.send(np.array(seen).reshape(-1, 2))


def beside(moments: np.ndarray, stills: list[np.ndarray], *, before: float, after: float) -> np.ndarray:
    """Mask of the moments within a stop of any core, or this long before or after it, shape (moment,); all in s."""
    hit = np.zeros(len(moments), bool)
    for begin, end in np.concatenate(stills):
        hit |= (moments >= begin - before) & (moments <= end + after)
    return hit
