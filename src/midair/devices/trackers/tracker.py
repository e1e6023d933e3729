"""A tracker of the palm: aligns its clock, returns the newest poses in the coordinates of the array, reports faults."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from midair.errors import DeviceError
from midair.model import PalmPath, TrackerPlacement
from midair.validation import setting

SAME_CLOCK = 0.25
"""Clocks whose least delay lies between 0 and this time, in s, are the same clock."""


class ClockFit:
    """The offset of a clock: the least delay (arrival minus stamp) of the last 5 s, .5 ms wrong at a drift of 100 ppm.

    The part of the delay that all messages have cannot be seen in them; it is a setting of the tracker. If the
    stamps are those of this computer's clock, they are times already, and the whole delay is seen.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget the clock, as after a jump of it."""
        self._least: deque[tuple[float, float]] = deque(maxlen=5)

    @property
    def started(self) -> bool:
        """Whether a stamp was added."""
        return bool(self._least)

    def add(self, stamp: float, arrived: float) -> None:
        """Add a message."""
        if not self._least or stamp - self._least[-1][0] >= 1.0:
            self._least.append((stamp, arrived - stamp))
        else:
            # The place of a bucket is that of its first message, so that buckets last 1 s.
            begun, least = self._least[-1]
            self._least[-1] = begun, min(least, arrived - stamp)

    def time(self, stamp: float) -> float:
        """The stamp on this computer's monotonic clock, in s."""
        offset = min(least for _, least in self._least)
        return stamp if 0 <= offset < SAME_CLOCK else stamp + offset


State = Literal["waiting", "tracking", "frozen", "lost", "closed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawPose:
    """A pose as a tracker sends it."""

    stamp: float
    """Time of the tracker's own clock, in s."""
    values: Sequence[float]
    """Centre in m, normal and direction of the fingers: 9 numbers in the tracker's coordinates."""
    confidence: float = 1.0


class PoseSource(Protocol):
    """The part of a tracker that depends on its protocol; all errors are `DeviceError`."""

    host_clock: bool
    """Whether its stamps are times of this computer's monotonic clock; otherwise they are aligned by `ClockFit`."""

    def open(self) -> None:
        """Connect to the tracker."""
        ...

    def pull(self, wait: float) -> Sequence[RawPose | str]:
        """Poses since the last call, waiting up to `wait` s for the first; a bad message is a text that describes it.

        It is called by a thread of its own. DeviceError if the connection is lost.
        """
        ...

    def close(self) -> None:
        """Disconnect; no effect if not open."""
        ...


@dataclass(frozen=True, kw_only=True)
class TrackerOptions(ABC):
    """A kind of tracker, with the options that may follow the question mark of its name."""

    latency_ms: float = setting(
        0.0,
        "Time from a pose to the arrival of its fastest message, if the tracker's clock is not that of this computer.",
        unit="ms",
        limits=(0, math.inf),
    )
    speed: float = setting(
        5.0, "Highest speed of a palm; poses further away are jumps.", unit="m/s", limits=(0, math.inf), above=True
    )
    reach: float = setting(1.5, "Largest distance from the tracker.", unit="m", limits=(0, math.inf), above=True)
    freeze: float = setting(
        0.1, "Time after which an unchanged pose counts as frozen; 0 for never.", unit="s", limits=(0, math.inf)
    )

    @abstractmethod
    def source(self, place: str) -> PoseSource:
        """Source at a place, the part of a name between colon and question mark; not open yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerStatus:
    """State of a tracker and counts of its poses."""

    state: State
    """"waiting" without a pose for 0.1 s, "lost" without a connection, which is tried again every second."""
    poses: int
    """Number of accepted poses."""
    age: float
    """Time since the newest accepted pose, in s; infinite before the first."""
    rate: float
    """Poses per second over the last ones."""
    confidence: float
    """Confidence of the newest pose."""
    latency: float
    """Median time from a pose to its arrival here, in s; without the part that `latency_ms` states, if not stated."""
    refused: Mapping[str, int]
    """Number of faults by kind: message, number, range, stamp, jump, frozen, flood, gap, confidence, lost."""


GAP, FASTEST = 0.1, 0.5e-3
"""Time without a pose that counts as a gap; least time between poses, those in between are a flood; in s."""
KEPT, LOW = 512, 0.3
"""Number of poses that are kept; confidence below which a pose is reported."""


class Tracker:
    """The poses of a palm from a source: aligned in time, checked, and in the coordinates of the array.

    A fault never raises here: the message is refused, its kind counted in `status`, and reported once by `events`.

    `placement` turns and shifts the poses; another `clock` than `time.monotonic` is read without a thread, for
    simulations.
    """

    def __init__(
        self,
        source: PoseSource,
        *,
        name: str,
        options: TrackerOptions,
        placement: TrackerPlacement | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name, self.source, self.options, self.clock = name, source, options, clock
        self.placement = placement or TrackerPlacement()
        self._fit = ClockFit()
        self._changed = threading.Condition()
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None
        self._open = self._lost = False
        self._rows: deque[NDArray[np.float64]] = deque(maxlen=KEPT)
        self._delays: deque[float] = deque(maxlen=128)
        self._count = 0
        self._faults: Counter[str] = Counter()
        self._reports: deque[str] = deque(maxlen=64)
        self._values: NDArray[np.float64] | None = None
        self._restart_clock()

    def open(self) -> None:
        """Connect to the tracker; raises DeviceError if it does not answer."""
        if self._open:
            return
        self.source.open()
        self._open, self._lost = True, False
        if self.clock is time.monotonic:
            self._ends.clear()
            self._thread = threading.Thread(target=self._run, name="midair tracker", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Disconnect; no effect if not open."""
        self._ends.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(5.0)
        if self._open:
            self._open = False
            self.source.close()

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def begin(self, at: float) -> None:
        """Set time 0 of replayed poses, as the first frame of a play; no effect on a live tracker."""
        if (begin := getattr(self.source, "begin", None)) is not None:
            with self._changed:
                self._rows.clear()
                self._restart_clock()
                begin(at)

    def poses(self, since: float = -math.inf) -> PalmPath | None:
        """Accepted poses later than `since` on the clock, oldest first, at most 512; None without one."""
        self._update()
        with self._changed:
            rows = [row for row in self._rows if row[0] > since]
        if not rows:
            return None
        return self.placement.path(PalmPath.from_rows(np.array(rows)))

    def newest(self) -> PalmPath | None:
        """The newest accepted pose, a path of length 1; None before the first."""
        self._update()
        with self._changed:
            last = self._rows[-1][0] if self._rows else math.inf
        return self.poses(float(np.nextafter(last, -np.inf)))

    def wait(self, since: float, timeout: float) -> bool:
        """Wait for a pose later than `since`; False if there is none within `timeout` s."""
        with self._changed:
            return self._changed.wait_for(lambda: bool(self._rows) and self._rows[-1][0] > since, timeout)

    def events(self) -> list[str]:
        """One line for each kind of fault and for each gap since the last call."""
        self._update()
        with self._changed:
            reports = list(self._reports)
            self._reports.clear()
        return reports

    def status(self) -> TrackerStatus:
        """State of the tracker now."""
        self._update()
        with self._changed:
            newest = self._rows[-1] if self._rows else None
            age = math.inf if newest is None else self.clock() - float(newest[0])
            recent = [row[0] for row in list(self._rows)[-64:]]
            late = age >= GAP + min(self._latency(), SAME_CLOCK)
            still: State = "frozen" if self.frozen else "waiting" if late else "tracking"
            return TrackerStatus(
                state="closed" if not self._open else "lost" if self._lost else still,
                poses=self._count,
                age=age,
                rate=(len(recent) - 1) / float(recent[-1] - recent[0]) if len(recent) > 1 else 0.0,
                confidence=0.0 if newest is None else float(newest[10]),
                latency=self._latency(),
                refused=dict(self._faults),
            )

    def _latency(self) -> float:
        return float(np.median(self._delays)) if self._delays else self.options.latency_ms * 1e-3

    def _update(self) -> None:
        """Read the source here if no thread does."""
        if self._thread is None and self._open:
            self._take_all(self.source.pull(0.0))

    def _run(self) -> None:
        while not self._ends.is_set():
            try:
                if self._lost:
                    self.source.open()
                    self._lost = False
                self._take_all(self.source.pull(0.1))
            except DeviceError as wrong:
                if not self._lost:
                    self._lost = True
                    self._report("lost", str(wrong))
                self.source.close()
                self._ends.wait(1.0)

    def _take_all(self, received: Sequence[RawPose | str]) -> None:
        arrived = self.clock()
        with self._changed:
            for one in received:
                if isinstance(one, str):
                    self._report("message", f"expected a pose, got {one}")
                else:
                    self._take(one, arrived)
            if received:
                self._changed.notify_all()

    def _take(self, pose: RawPose, arrived: float) -> None:
        values = np.array(pose.values, np.float64)
        if not (np.isfinite(values).all() and math.isfinite(pose.stamp) and math.isfinite(pose.confidence)):
            self._report("number", "expected finite numbers, got NaN or infinity")
            return
        if not self._in_range(values, pose.confidence) or not self._stamp_fits(pose.stamp, arrived):
            return
        self._fit.add(pose.stamp, arrived)
        at = self._time(pose.stamp)
        last = self._rows[-1] if self._rows else None
        if self._values is None or not np.array_equal(values, self._values):
            self._values, self._same_since = values, pose.stamp
        if self.frozen:
            self._report("frozen", f"the pose has not changed by one bit for {1e3 * self.options.freeze:.0f} ms")
            return
        if last is not None:
            way, speed = float(np.linalg.norm(values[:3] - last[1:4])), self.options.speed
            # 2 ms and 2 mm for the error of the stamps and of the tracker.
            if way > 2e-3 + speed * (max(at - last[0], 0.0) + 2e-3):
                self._report("jump", f"expected at most {speed:g} m/s, got a jump of {1e3 * way:.0f} mm")
                return
            if at - last[0] > GAP:
                self._report("gap", f"no pose for {1e3 * (at - last[0]):.0f} ms", every=True)
            # A better offset of the clock may lie below the last time.
            at = max(at, last[0] + 1e-6)
        if pose.confidence < LOW:
            self._report("confidence", f"expected a confidence of {LOW:g} or more, got {pose.confidence:.2g}")
        self._accepted_stamp = pose.stamp
        self._count += 1
        self._delays.append(arrived - at)
        self._rows.append(np.concatenate([[at], values[:3], _frame(values), [pose.confidence]]))

    def _in_range(self, values: NDArray[np.float64], confidence: float) -> bool:
        lengths = np.linalg.norm(values.reshape(3, 3), axis=1)
        if lengths[0] > self.options.reach:
            self._report("range", f"expected a palm within {self.options.reach:g} m, got {lengths[0]:.3g} m")
        elif np.abs(lengths[1:] - 1).max() > 0.1 or abs(values[3:6] @ values[6:9]) > 0.5:
            self._report("range", "expected unit vectors at right angles for normal and fingers, got others")
        elif not 0 <= confidence <= 1:
            self._report("range", f"expected a confidence of 0 to 1, got {confidence:.3g}")
        else:
            return True
        return False

    def _stamp_fits(self, stamp: float, arrived: float) -> bool:
        """Whether a stamp follows the last one and is not of the future; a clock that stays wrong for 1 s is new."""
        ahead = self._fit.started and self._time(stamp) - arrived > 0.25
        if stamp > self._stamp and not ahead:
            self._bad_stamps_since = None
            if stamp - self._accepted_stamp < FASTEST:
                self._report("flood", f"expected at most {1 / FASTEST:.0f} poses a second, got more")
                return False
            self._stamp = stamp
            return True
        self._bad_stamps_since = self._bad_stamps_since or arrived
        if arrived - self._bad_stamps_since > 1.0:
            self._restart_clock()
        got = "one of the future" if ahead else "an old one"
        self._report("stamp", f"expected increasing time stamps of now, got {got}")
        return False

    def _time(self, stamp: float) -> float:
        return stamp if self.source.host_clock else self._fit.time(stamp) - self.options.latency_ms * 1e-3

    def _restart_clock(self) -> None:
        self._fit.restart()
        self._stamp = self._same_since = self._accepted_stamp = -math.inf
        self._bad_stamps_since: float | None = None

    @property
    def frozen(self) -> bool:
        """Whether the poses have not changed by one bit for the time that the option `freeze` states."""
        return 0 < self.options.freeze < self._stamp - self._same_since < math.inf

    def _report(self, kind: str, text: str, *, every: bool = False) -> None:
        self._faults[kind] += 1
        if every or self._faults[kind] == 1:
            self._reports.append(f"{self.name}: {text}")


def _frame(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normal and fingers of length 1 and at right angles."""
    normal = values[3:6] / np.linalg.norm(values[3:6])
    fingers = values[6:9] - (values[6:9] @ normal) * normal
    return np.concatenate([normal, fingers / np.linalg.norm(fingers)])
