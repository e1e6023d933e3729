"""`midair.live`: start the process of the loop, renew its lease, write the take, report statistics."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from midair.devices import ExposureClearance, LeaseToken, PlayLease
from midair.errors import DeviceError, DeviceStateError, MidairError
from midair.model import RATE, Placement
from midair.processes import start_process
from midair.rig.live_touch.live_settings import RISE, LiveSettings
from midair.rig.live_touch.live_take import LiveTake
from midair.rig.live_touch.process import LoopStarted, live_rig, play_live
from midair.rig.live_touch.touch_ring import STEP, TouchRing
from midair.rig.session import Session
from midair.validation import checked_call

SLOTS, CHANNELS = 8192, 64
"""Frames that the ring holds for slow readers; maximum number of channels of a live sensor."""

RATE_SPAN = 5.0
"""Time in s over which the sensor's rate is measured at least; jitter of 20 ms is then 0.4 %."""

COUNTS = ("frames", "played", "lost", "late", "hot", "hurried", "unanswered", "gaps", "failsafe")
"""Counts of `LiveStatistics`, in the ring under the same names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveStatistics:
    """Statistics of a live run."""

    frames: int
    """Frames of the sensor, lost ones included."""
    played: int
    """Frames that were emitted."""
    lost: int
    """Frames that the sensor lost: the last good one was repeated."""
    late: int
    """Frames that were ready after their instant or did not fit into a queue: the previous frame stayed."""
    hot: int
    """Frames that were dropped while a unit was too hot."""
    hurried: int
    """Frames that had less than half of the hold left, and were solved in half the time."""
    unanswered: int
    """Frames that were sent without a confirmation from any unit."""
    gaps: int
    """Number of gaps of 20 ms without a frame, after which the level faded."""
    failsafe: int
    """Number of times that the units' failsafe silenced them, after 50 ms without a frame; the level rose again."""
    latency: float
    """Median latency from skin to skin in s: filter, hold, transducers and air."""
    parts: dict[str, float]
    """Parts of the latency in s."""
    left: tuple[float, ...]
    """Quantiles (50, 99, 99.9 and 100 %) of the time from sampling a frame to sending it, in s; NaN before the first.
    """
    work: tuple[float, ...]
    """Quantiles of the computing time of a frame in s, as for `left`."""
    over_time: dict[str, tuple[int, ...]]
    """Late and lost frames, and gaps, in each tenth of the run so far."""
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

    def plain(self) -> dict[str, Any]:
        """Return plain values, with times in ms."""
        names = ("half", "99%", "99.9%", "all")
        return {
            **{name: getattr(self, name) for name in COUNTS},
            "latency": round(1e3 * self.latency, 3),
            "latency_parts_ms": {name: round(1e3 * part, 3) for name, part in self.parts.items()},
            "left_ms": {name: _ms(each) for name, each in zip(names, self.left, strict=True)},
            "work_ms": {name: _ms(each) for name, each in zip(names, self.work, strict=True)},
            "over_time": {name: list(counts) for name, counts in self.over_time.items()},
            "stated_rate_hz": self.stated_rate,
            "rate_hz": None if self.rate is None else round(self.rate, 3),
        }


class LiveSession:
    """A run of live touch; a context manager that is silent and has ended after leaving.

    `lease` is one that another program renews, with the token of its arming; by default it is renewed while this
    process runs. `wait` calls `report` with one line when a pause for cooling or following the palm begins or ends.
    `keep` and `notes` as in `live`.
    """

    def __init__(
        self,
        order: LiveSettings,
        *,
        keep: Path | None = None,
        notes: dict[str, str] | None = None,
        lease: tuple[PlayLease, LeaseToken] | None = None,
        report: Callable[[str], object] | None = None,
    ) -> None:
        self._report = report
        self.order, self._keep, self._notes = order, keep, notes or {}
        units = (order.placement or Placement.grid()).array().count
        self.ring = TouchRing(SLOTS, CHANNELS, units)
        self._own = lease is None
        self.lease, self._token = lease or (PlayLease(), None)
        self._process: Any = None
        self._told: Any = None
        self._ended: MidairError | bool = False
        self._opened: LoopStarted | None = None
        self._take: LiveTake | None = None
        self._over = threading.Event()
        self._threads: list[threading.Thread] = []

    @property
    def opened(self) -> LoopStarted:
        """State of the opened devices; DeviceStateError before entering."""
        if self._opened is None:
            raise DeviceStateError("live: expected a session that was entered before reading its state")
        return self._opened

    @property
    def running(self) -> bool:
        """Whether it is playing."""
        return self._process is not None and self._process.is_alive() and not self._ended

    @property
    def statistics(self) -> LiveStatistics:
        """Statistics of the run so far."""
        ring, opened = self.ring, self.opened
        order = self.order
        parts = {
            "filter": opened.delay,
            "hold": opened.schedule.hold,
            "rise and air": RISE + order.height / order.acoustics.medium.speed,
        }
        return LiveStatistics(
            **{name: ring.count(name) for name in COUNTS},
            latency=sum(parts.values()),
            parts=parts,
            left=_quantiles(ring.histogram("left")),
            work=_quantiles(ring.histogram("work")),
            stated_rate=opened.rate,
            rate=ring.count("timed") / span if (span := 1e-6 * ring.count("span_us")) >= RATE_SPAN else None,
            over_time=ring.over_time(ring.count("frames") / (opened.schedule.formed * opened.rate)),
        )

    def since(self, seen: int) -> tuple[NDArray[Any], int, int]:
        """Frames from a number on, as `TouchRing.since`; the sensor's channels are the first of 64."""
        return self.ring.since(seen)

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until it has ended, or for `seconds`; return whether it plays, or raise the error that ended it."""
        until = None if seconds is None else time.monotonic() + seconds
        while self.running and (until is None or time.monotonic() < until):
            self._receive(0.05 if until is None else min(0.05, max(0.0, until - time.monotonic())))
        self._raise()
        return self.running

    def stop(self) -> None:
        """Silence at once and end the session."""
        self.lease.stop()

    def __enter__(self) -> Self:
        token = self._token or self.lease.arm()
        self._told, tells = Pipe(duplex=False)
        self._start("lease", lambda: self._renew(token))
        try:
            arguments = (self.order, self.ring, self.lease, token, tells)
            self._process = start_process(play_live, *arguments, name="midair live")
            # The end of the process is then the end of the pipe.
            tells.close()
            while self._opened is None and not self._ended:
                self._receive(0.1)
            self._raise()
            if self._keep is not None:
                self._take = LiveTake(self._keep, self.order, self.opened, self.ring.since, self._notes)
                self._start("take", self._take.run)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        self._end()
        if error is None:
            self._raise()

    def _renew(self, token: LeaseToken) -> None:
        while self._own and not self._over.wait(0.1):
            if self.lease.refusal(token) is not None:
                return
            self.lease.renew()

    def _start(self, name: str, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work, name=f"live {name}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _receive(self, wait: float) -> None:
        try:
            if not self._told.poll(wait):
                return
            said = self._told.recv()
        except (EOFError, OSError):
            self._process.join(1)
            if not self._ended:
                self._ended = DeviceError(
                    f"live: the playing process ended with status {self._process.exitcode} without a report; the "
                    "array's own failsafe has silenced it; start again"
                )
            return
        if isinstance(said, LoopStarted):
            self._opened = said
        elif isinstance(said, str):
            if self._report is not None:
                self._report(said)
        else:
            self._ended = said or True

    def _raise(self) -> None:
        if isinstance(self._ended, MidairError):
            raise self._ended

    def _end(self) -> None:
        """End in order within a time limit, else at once."""
        self.ring.end()
        # A process that has not opened its devices emits no sound.
        until = time.monotonic() + (0 if self._opened is None else 5)
        while self._process is not None and not self._ended and time.monotonic() < until:
            self._receive(0.1)
        self._over.set()
        with suppress(DeviceStateError):
            self.lease.stop()
        if self._process is not None:
            self._process.join(2)
            if self._process.is_alive():
                self._process.kill()
        if self._take is not None:
            self._take.end()
        for thread in self._threads:
            thread.join(5)
        take, self._take = self._take, None
        if take is not None:
            take.close()


def _quantiles(histogram: NDArray[np.int64]) -> tuple[float, ...]:
    """Upper bin edges of the 50, 99, 99.9 and 100 % quantiles."""
    total = histogram.sum()
    if not total:
        return (np.nan,) * 4
    so_far = np.cumsum(histogram)
    return tuple(float((np.searchsorted(so_far, share * total) + 1) * STEP) for share in (0.5, 0.99, 0.999, 1.0))


def _ms(seconds: float) -> float | None:
    return None if np.isnan(seconds) else round(1e3 * seconds, 3)


@checked_call
def live(
    sensor: str | None = None,
    device: str | None = None,
    *,
    settings: LiveSettings | None = None,
    keep: str | Path | None = None,
    notes: dict[str, str] | None = None,
    lease: tuple[PlayLease, LeaseToken] | None = None,
    report: Callable[[str], object] | None = None,
    **changes: Any,
) -> LiveSession:
    """Play a sensor's signal on an array, 13 ms later by default; a context manager that is silent after leaving.

    It runs in a separate process. A script has to start it below ``if __name__ == "__main__":``, since that process
    imports the script as well. Raises InputError if a value is out of range, or a sensor is too slow for live touch.

    Parameters
    ----------
    sensor, device : str, optional
        Names of the sensor and of the array, as in `LiveSettings`.
    settings : LiveSettings, optional
        All settings; the defaults if None.
    keep : str or Path, optional
        File for a take of the sensor's samples and the emitted phases.
    notes : dict of str to str, optional
        Notes of the take.
    lease : (PlayLease, LeaseToken), optional
        Lease that another program renews and can stop, and the token of its arming; a lease of its own if None.
    report : callable, optional
        Called by ``wait`` with one line when following the palm, or a pause of ``cooling_limit``, begins or ends.
    **changes
        Fields of `LiveSettings` that differ from `settings`, such as ``height=0.15``. Calibration, wiring and placement
        may be the path of a file.

    Returns
    -------
    LiveSession
        Enter it with ``with``: ``wait(seconds)``, ``statistics``, ``stop()``.

    Examples
    --------
    >>> with midair.live("virtual:towel", duration=2.0) as session:
    ...     session.wait()
    ...     print(session.statistics.late)
    """
    named: dict[str, Any] = {
        name: value for name, value in (("sensor", sensor), ("device", device)) if value is not None
    }
    order = (settings or LiveSettings()).but(**named, **changes)
    return LiveSession(order, keep=None if keep is None else Path(keep), notes=notes, lease=lease, report=report)


def live_clearance(order: LiveSettings) -> ExposureClearance:
    """Check the exposure of live settings without opening a device; `live` checks again with the device.

    `rate` is the frame rate in Hz. Raises ExposureError if the worst case at this level exceeds the profile without an
    override.
    """
    return Session(rig=live_rig(order, RATE)).clear_level(order.level, order.schedule(RATE).formed * RATE)
