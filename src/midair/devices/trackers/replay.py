"""Replayed poses, in real time or on the clock of a simulation."""

import math
import time
from collections.abc import Callable

import numpy as np

from midair.devices.trackers.tracker import RawPose
from midair.model import PalmPath


class ReplaySource:
    """Sends each pose, in the tracker's coordinates, `latency` s after its time, which counts from `begin`, once."""

    host_clock = True

    def __init__(self, palm: PalmPath, *, latency: float = 0.0) -> None:
        self.clock: Callable[[], float] = time.monotonic
        self._times, self._latency = palm.time, latency
        self._rows = np.column_stack([palm.centre, palm.normal, palm.fingers])
        self._confidence = palm.confidence
        self.begin(math.inf)

    def begin(self, at: float) -> None:
        """Set time 0 of the poses on the clock."""
        self._zero, self._next = at, 0

    def open(self) -> None:
        """Set time 0 to now."""
        self.begin(self.clock())

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses that have arrived."""
        if wait and self._next < len(self._times):
            left = self._zero + self._times[self._next] + self._latency - self.clock()
            time.sleep(float(np.clip(left, 0.0, wait)))
        elif wait:
            time.sleep(wait)
        end = int(np.searchsorted(self._times, self.clock() - self._zero - self._latency, "right"))
        first, self._next = self._next, max(end, self._next)
        return [
            RawPose(
                stamp=float(self._zero + self._times[at]), values=self._rows[at], confidence=float(self._confidence[at])
            )
            for at in range(first, self._next)
        ]

    def close(self) -> None:
        """Nothing to disconnect."""
