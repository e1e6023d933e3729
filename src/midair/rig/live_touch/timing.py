"""Instants of frames, and real-time rights of the process."""

import ctypes
import ctypes.util
import gc
import os
import sys
from dataclasses import dataclass

import numpy as np

from midair.devices import TICK


class Timetable:
    """Instants on a regular grid, a hold after the sampling times, that follow the sensor's clock slowly.

    Frames have a constant period despite jitter of the time stamps: the grid moves by one tick at a time towards the
    mean of the stamps over `over` frames. A deviation above `far`, after a pause of sensor or computer, starts a new
    grid, and so does `restart`. All times in ns.
    """

    def __init__(self, period: int, hold: int, *, far: int = 50_000_000, over: int = 256) -> None:
        self._period, self._hold, self._far, self._over = period, hold, far, over
        self._number, self._instant, self._off = -1, 0, 0.0

    def restart(self) -> None:
        """Start a new grid with the next frame."""
        self._number = -1

    def instant(self, number: int, taken: int) -> int:
        """Instant of a frame that was sampled at `taken`, in ns of device time; numbers may skip."""
        grid = self._instant + (number - self._number) * self._period
        off = taken + self._hold - grid
        if self._number < 0 or abs(off) > self._far:
            grid, self._off = -(-(taken + self._hold) // TICK) * TICK, 0.0
        else:
            self._off += (off - self._off) / self._over
            if abs(self._off) > TICK:
                step = TICK if self._off > 0 else -TICK
                grid, self._off = grid + step, self._off - step
        self._number, self._instant = number, grid
        return grid


RATE_SPAN = 5.0
"""Time in s over which the sensor's rate is measured at least; jitter of 20 ms is then 0.4 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorRate:
    """Frame rate that a sensor states, and the one that was measured."""

    stated_rate: float
    """Frame rate in Hz that the sensor states."""
    rate: float | None
    """Frame rate in Hz by this computer's clock; None in the first 5 s."""

    @property
    def rate_error(self) -> float:
        """Relative deviation of the measured from the stated frame rate; 0 before it is measured."""
        return 0.0 if self.rate is None else self.rate / self.stated_rate - 1

    @property
    def rate_problem(self) -> str:
        """Message for a rate that differs by more than 1 %; else empty."""
        if self.rate is None or abs(self.rate_error) <= 0.01:
            return ""
        return (
            f"sensor: expected {self.stated_rate:g} frames per second, measured {self.rate:.4g} by this computer's "
            f"clock, so that frames are late; state the true rate, such as ?rate={self.rate:.0f}, or correct the sensor"
        )

    def plain_rate(self) -> dict[str, float | None]:
        """As plain values."""
        return {"stated_rate_hz": self.stated_rate, "rate_hz": None if self.rate is None else round(self.rate, 3)}


def measured_rate(frames: int, span: float) -> float | None:
    """Rate in Hz of so many frames in `span` s; None if the span is too short."""
    return frames / span if span >= RATE_SPAN else None


class RateMeter:
    """Counts frames against the computer's clock; steps of more than `pause` s, after lost frames, are left out."""

    def __init__(self, *, pause: float = 0.05) -> None:
        self.frames, self.span = 0, 0.0
        self._pause, self._number, self._taken = pause, -1, -np.inf

    def add(self, number: int, taken: float) -> None:
        """Add a frame that was sampled at `taken`, in s."""
        step = taken - self._taken
        if abs(step) < self._pause:
            self.frames += number - self._number
            self.span += step
        self._number, self._taken = number, taken


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerGrant:
    """Real-time rights that the computer granted to this process."""

    priority: str
    """Empty if real-time priority was granted; else the reason."""
    memory: str
    """Empty if the memory was locked; else the reason."""

    def words(self) -> str:
        """Describe in one line."""
        first = "real-time priority" if not self.priority else f"no real-time priority ({self.priority})"
        second = "memory locked" if not self.memory else f"memory not locked ({self.memory})"
        return f"{first}, {second}"


def request_realtime(priority: int = 20) -> SchedulerGrant:
    """Request real-time priority (1 to 99, 0 for none) and lock the memory; switch off the garbage collector.

    Threads that start later inherit the priority, so call this before an SDK starts its threads.
    """
    gc.collect()
    gc.disable()
    # Other threads of this process receive and send frames: they must not wait 5 ms for their turn.
    sys.setswitchinterval(5e-5)
    return SchedulerGrant(priority=_take_priority(priority), memory=_lock_memory())


def _take_priority(priority: int) -> str:
    if not priority:
        return "none was asked for"
    if not hasattr(os, "sched_setscheduler"):
        return "not known on this system"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as wrong:
        return f"{wrong.strerror}; allow rtprio in /etc/security/limits.d"
    return ""


def _lock_memory() -> str:
    """Lock all memory with mlockall(2), MCL_CURRENT and MCL_FUTURE, so that no page has to be read from a disk."""
    if sys.platform != "linux":
        return "not known on this system"
    library = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)
    return "" if library.mlockall(3) == 0 else os.strerror(ctypes.get_errno())
