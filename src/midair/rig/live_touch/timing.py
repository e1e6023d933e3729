"""Instants of frames, and real-time rights of the process."""

import ctypes
import ctypes.util
import gc
import os
import sys

import numpy as np

from midair.devices import TICK


class Timetable:
    """Instants on a regular grid, a hold after the sampling times, that follow the sensor's clock slowly.

    Frames have a constant period despite jitter of the time stamps: the grid moves by one tick at a time towards the
    mean of the stamps over 256 frames. A deviation above `far`, after a pause of sensor or computer, starts a new
    grid, and so does `restart`. All times in ns.
    """

    def __init__(self, period: int, hold: int, *, far: int = 50_000_000) -> None:
        self._period, self._hold, self._far = period, hold, far
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
            self._off += (off - self._off) / 256
            if abs(self._off) > TICK:
                step = TICK if self._off > 0 else -TICK
                grid, self._off = grid + step, self._off - step
        self._number, self._instant = number, grid
        return grid


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


def request_realtime(priority: int = 20) -> str:
    """Request real-time priority (1 to 99, 0 for none), lock the memory, and switch off the garbage collector.

    Returns what the computer granted, in one line.

    Threads that start later inherit the priority, so call this before an SDK starts its threads.
    """
    gc.collect()
    gc.disable()
    # Other threads of this process receive and send frames: they must not wait 5 ms for their turn.
    sys.setswitchinterval(5e-5)
    refused, unlocked = _take_priority(priority), _lock_memory()
    first = f"no real-time priority ({refused})" if refused else "real-time priority"
    return f"{first}, {f'memory not locked ({unlocked})' if unlocked else 'memory locked'}"


def _take_priority(priority: int) -> str:
    """The reason why real-time priority was not granted; empty if it was."""
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
    """Lock all memory with mlockall(2), MCL_CURRENT and MCL_FUTURE; return the reason if that failed."""
    if sys.platform != "linux":
        return "not known on this system"
    library = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)
    return "" if library.mlockall(3) == 0 else os.strerror(ctypes.get_errno())
