"""Drift of one clock against another, from pairs of readings of which the second may be delayed."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

LARGEST = 256
"""Maximum number of points of the fitted line; beyond it, neighbours are merged, which bounds the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Drift of a clock against this computer's."""

    ppm: float
    """Drift in parts per million; positive if the clock is faster."""
    uncertainty: float
    """Two standard errors of the slope, in parts per million."""
    span: float
    """Observed time in s."""
    points: int = 1000
    """Number of points of the line."""

    @property
    def certain(self) -> bool:
        """Whether the drift exceeds rounding, and by Student's t what jitter alone causes in one of 10,000 looks.

        A recording looks again every second, so that a limit of two standard errors would soon be exceeded by chance.
        """
        errors = float(stdtrit(self.points - 2, 1 - 0.5e-4))
        return abs(self.ppm) > max(errors * self.uncertainty / 2, 0.01)


class ClockWatch:
    """Compares a device's clock, or its frame count over its rate, with this computer's.

    Blocks arrive with varying delay, never early. So of each second only the least delayed reading counts (the lower
    envelope of the delay; V. Paxson, "On calibrating measurements of packet transit times", SIGMETRICS 1998), and the
    drift is the slope of a least-squares line through them.
    """

    def __init__(self, *, every: float = 1.0) -> None:
        self._every = every
        self._begin: tuple[float, float] | None = None
        self._points: list[tuple[float, float]] = []  # (host time, lead of the device) since begin, in s
        self._cell, self._best = 0, (0.0, -np.inf)

    def add(self, device: float, host: float) -> None:
        """Add a reading of both clocks in s."""
        if self._begin is None:
            self._begin = device, host
        t = host - self._begin[1]
        ahead = device - self._begin[0] - t
        if int(t / self._every) > self._cell:
            self._keep()
            self._cell = int(t / self._every)
        if ahead > self._best[1]:
            self._best = t, ahead

    def drift(self) -> Drift | None:
        """Drift so far; None before there are five points."""
        if len(self._points) < 5:
            return None
        t, ahead = np.array(self._points).T
        t = t - t.mean()
        slope = float(t @ ahead / (t @ t))
        rest = ahead - ahead.mean() - slope * t
        error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
        return Drift(ppm=1e6 * slope, uncertainty=2e6 * error, span=float(np.ptp(t)), points=len(t))

    def _keep(self) -> None:
        if self._best[1] > -np.inf:
            self._points.append(self._best)
        self._best = 0.0, -np.inf
        if len(self._points) >= LARGEST:
            pairs = zip(self._points[::2], self._points[1::2], strict=True)
            self._points = [max(pair, key=lambda point: point[1]) for pair in pairs]
            self._every *= 2
