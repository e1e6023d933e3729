"""How fast one clock runs against another, from pairs of readings of which the second may come late."""

from dataclasses import dataclass

import numpy as np

LARGEST = 256
"""Points that the line is laid through, at most; beyond, two neighbours become one and the memory stays bounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """How much faster a clock runs than this computer's.

    Attributes
    ----------
    ppm : float
        In millionths.
    uncertainty : float
        Two standard errors of the line, in millionths.
    span : float
        Time that was looked at, in s.
    """

    ppm: float
    uncertainty: float
    span: float

    @property
    def certain(self) -> bool:
        """Whether it differs from none by more than its uncertainty, and by more than rounding."""
        return abs(self.ppm) > max(self.uncertainty, 0.01)


class ClockWatch:
    """Compares a device's clock, or its count of frames over its rate, with this computer's.

    A block arrives late by a different time each, never early. So of each second only the reading that came soonest
    counts (the lower envelope of the delay; V. Paxson, "On calibrating measurements of packet transit times",
    SIGMETRICS 1998), and the drift is the slope of a line of least squares through them.
    """

    def __init__(self, *, every: float = 1.0) -> None:
        self._every = every
        self._begin: tuple[float, float] | None = None
        self._points: list[tuple[float, float]] = []  # host time, ahead by: both since begin, in s
        self._cell, self._best = 0, (0.0, -np.inf)

    def add(self, device: float, host: float) -> None:
        """A reading of both clocks, in s."""
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
        """What can be said so far; None before there are five points."""
        if len(self._points) < 5:
            return None
        t, ahead = np.array(self._points).T
        t = t - t.mean()
        slope = float(t @ ahead / (t @ t))
        rest = ahead - ahead.mean() - slope * t
        error = float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))
        return Drift(ppm=1e6 * slope, uncertainty=2e6 * error, span=float(np.ptp(t)))

    def _keep(self) -> None:
        if self._best[1] > -np.inf:
            self._points.append(self._best)
        self._best = 0.0, -np.inf
        if len(self._points) >= LARGEST:
            pairs = zip(self._points[::2], self._points[1::2], strict=True)
            self._points = [max(pair, key=lambda point: point[1]) for pair in pairs]
            self._every *= 2
