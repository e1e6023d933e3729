"""Alignment of a tracker's clock with this computer's by the messages that were delayed least."""

from collections import deque
from itertools import pairwise

import numpy as np

SAME_CLOCK = 0.25
"""Clocks whose least delay lies between 0 and this time, in s, are the same clock."""


class ClockFit:
    """A line below the delays (arrival minus stamp) of the last `buckets` s, which gives offset and drift of the clock.

    The part of the delay that all messages have cannot be seen in them; it is a setting of the tracker. If the
    stamps are those of this computer's clock, they are times already, and the whole delay is seen.
    """

    def __init__(self, buckets: int = 20) -> None:
        self._buckets = buckets
        self.restart()

    def restart(self) -> None:
        """Forget the clock, as after a jump of it."""
        self._least: deque[tuple[float, float]] = deque(maxlen=self._buckets)
        self._line = (0.0, 0.0, 0.0)

    @property
    def started(self) -> bool:
        """Whether a stamp was added."""
        return bool(self._least)

    def add(self, stamp: float, arrived: float) -> None:
        """Add a message."""
        delay = arrived - stamp
        if not self._least or stamp - self._least[-1][0] >= 1.0:
            self._least.append((stamp, delay))
        elif delay < self._least[-1][1]:
            # The place of a bucket is that of its first message, so that buckets last 1 s.
            self._least[-1] = (self._least[-1][0], delay)
        elif len(self._least) > 1:
            return
        self._line = self._fitted()

    def time(self, stamp: float) -> float:
        """The stamp on this computer's monotonic clock, in s."""
        at, offset, slope = self._line
        offset += slope * (stamp - at)
        return stamp if 0 <= offset < SAME_CLOCK else stamp + offset

    def _fitted(self) -> tuple[float, float, float]:
        """Stamp, offset and slope of the edge of the lower hull below the middle; no slope before 5 s."""
        points = np.array(self._least)
        if len(points) < 5:
            return points[-1, 0], points[:, 1].min(), 0.0
        hull: list[np.ndarray] = []
        for point in points:
            while len(hull) > 1 and np.linalg.det([hull[-1] - hull[-2], point - hull[-2]]) <= 0:
                hull.pop()
            hull.append(point)
        middle = points[:, 0].mean()
        left, right = next(pair for pair in pairwise(hull) if pair[1][0] >= middle)
        slope = float(np.clip((right[1] - left[1]) / (right[0] - left[0]), -2e-4, 2e-4))
        return left[0], left[1], slope
