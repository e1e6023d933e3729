"""When frames are to sound, and what a computer grants to those who must not be late."""

import ctypes
import ctypes.util
import gc
import os
import sys
from dataclasses import dataclass

TICK = 25_000
"""Period of the ultrasound in ns: instants of units are multiples of it."""


class Timetable:
    """Instants on an even grid, a hold after the frames were taken, that follow the sensor's clock slowly.

    A frame every period, whatever the jitter of the stamps: the grid moves by a tick at a time towards where the stamps
    are on average. What is far off, after the sensor or the computer stood still, begins a new grid.

    Parameters
    ----------
    period : int
        Between two frames, in ns.
    hold : int
        From a frame's being taken to its instant, in ns.
    far : int
        In ns.
    over : int
        Frames over which stamps are averaged.
    """

    def __init__(self, period: int, hold: int, *, far: int = 50_000_000, over: int = 256) -> None:
        self._period, self._hold, self._far, self._over = period, hold, far, over
        self._number, self._instant, self._off = -1, 0, 0.0

    def instant(self, number: int, taken: int) -> int:
        """The instant of a frame of this number that was taken at `taken`, in ns of device time; numbers may skip."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerGrant:
    """What the computer granted to this process.

    Attributes
    ----------
    priority : str
        Empty if real-time priority was granted; else why not.
    memory : str
        Empty if its memory was locked; else why not.
    """

    priority: str
    memory: str

    def words(self) -> str:
        """As one line."""
        first = "real-time priority" if not self.priority else f"no real-time priority ({self.priority})"
        second = "memory locked" if not self.memory else f"memory not locked ({self.memory})"
        return f"{first}, {second}"


def request_realtime(priority: int = 20) -> SchedulerGrant:
    """Take real-time priority and lock the memory, where that is granted; the collector of garbage is switched off.

    Threads that are started later have the priority too, so this comes before an SDK starts its own.

    Parameters
    ----------
    priority : int
        1 to 99; below what the system's own threads have. 0 asks for none.
    """
    gc.collect()
    gc.disable()
    # Other threads of this process take frames in and send them: they must not wait 5 ms for their turn.
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
        return f"{wrong.strerror}; midair doctor says how"
    return ""


def _lock_memory() -> str:
    """MCL_CURRENT and MCL_FUTURE of mlockall(2), so that no page of this process has to be fetched from a disk."""
    if sys.platform != "linux":
        return "not known on this system"
    library = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)
    return "" if library.mlockall(3) == 0 else os.strerror(ctypes.get_errno())
