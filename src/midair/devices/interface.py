"""Interfaces of sensors and arrays.

A device is a context manager: it opens on entry, and on exit it stops and closes, also after an error; an array is
silenced first. To add a device, write a subclass in its own file and implement the abstract methods.
"""

import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from midair.devices.exposure_check import ExposureClearance
from midair.devices.frame_bytes import PHASE_STEPS
from midair.devices.safety.play_log import Ending, exposed, hours_error, log_end, log_order, log_pause, sound_left
from midair.devices.safety.stop_guard import StopGuard
from midair.errors import DeviceError, DeviceStateError, InputError
from midair.model import Calibration, Drive, Medium, Progress, SensorGrid, SensorWiring, TransducerArray, Unit
from midair.physics import ExposureProfile
from midair.streaming import Stored
from midair.validation import within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameBlock:
    """Consecutive frames of a sensor."""

    samples: NDArray[np.float64]
    """Shape (frame, row, column), in the sensor's unit."""
    first: int
    """Index of the first frame since start; a gap after the previous block means lost frames."""
    device_time: float
    """Time of the first frame on the device's clock, in s: its time stamp, or the number of frames over the rate."""
    host_time: float
    """Time of the first frame on this computer's monotonic clock (`time.monotonic`), in s, as accurately as known.

    The slope of one time over the other is the drift of the device's clock. A virtual sensor sets both to the same
    value.
    """
    overflow: bool = False
    """True if frames were lost before this block."""

    def __repr__(self) -> str:
        lost = ", after lost frames" if self.overflow else ""
        return f"<FrameBlock {len(self.samples)} frames from {self.first} at {self.device_time:.3f} s{lost}>"


class SensorDevice(ABC):
    """A pressure sensor that delivers blocks of frames."""

    name: str
    """The name that it was opened with, such as ``virtual:towel``."""
    grid: SensorGrid
    rate: float
    """Frames per second, in Hz."""
    unit: Unit
    calibration: Calibration | None = None
    """Calibration that the device provides."""
    simulated: bool = False
    full_scale: float | None = None
    """Magnitude in `unit` at which it clips, if known."""
    wiring: SensorWiring | None = None
    """Assignment of the source's channels to cells; None for a source without channels."""
    on_demand: bool = False
    """True if its time advances only when it is read, as for a replayed file."""
    stored: Stored = "f8"
    """Type for storage: "f4" if float32 represents every sample exactly."""

    def open(self) -> None:  # noqa: B027
        """Open the device, if there is one."""

    @abstractmethod
    def start(self) -> None:
        """Start sampling: frame 0 is the first one after this call."""

    @abstractmethod
    def read(self, frames: int) -> FrameBlock:
        """Return the next `frames` frames; fewer before a gap and at the end, none if the source has ended.

        Raises DeviceStateError if it was not started, DeviceError if it times out or the connection is lost; frames
        that arrived before are returned first.
        """

    @abstractmethod
    def stop(self) -> None:
        """Stop sampling; no effect if not started."""

    def close(self) -> None:  # noqa: B027
        """Close the device, if there is one; no effect if not open."""

    def describe(self) -> dict[str, str]:
        """Device information and counters since start, by name."""
        return {}

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayReport:
    """Result of playing a drive on an array."""

    frames: int
    """Number of frames played, including all repeats."""
    duration: float
    """Time from the first frame to the end of the last, without gaps, in s."""
    late: int = 0
    """Number of frames that began late."""
    repeated: int = 0
    """Number of frames that lasted too long."""
    start: int | None = None
    """Device time of the first frame in ns, the same on all units; None without such a clock."""
    gap: float = 0.0
    """Silence between frames, in s."""
    silencer: str = ""
    """Setting of the firmware's silencer, as text; empty if there is none."""
    units: str = ""
    """State of the units during playback, as text; empty if it cannot be queried."""
    paused: float = 0.0
    """Silence while units were too hot, in s; part of neither `duration` nor `gap`."""

    @property
    def broken(self) -> str:
        """One line if more than a tenth of the touch was missing; empty if it was whole."""
        held = self.late / max(1, self.frames) * self.duration
        if (lost := self.gap or held) <= 0.1 * self.duration:
            return ""
        what = "silence" if self.gap else "frames that came too late"
        return (
            f"the touch was broken: {1e3 * lost:.3g} ms of {what} in {1e3 * self.duration:.4g} ms of touch, since this "
            "computer was too slow; close other programs and play it again"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Cooling:
    """Permission to wait in silence for units that are too hot, instead of ending with an error."""

    limit: float = 600.0
    """Longest pause, in s; playback then ends with TooHotError."""
    report: Callable[[str], object] = lambda _: None
    """Called with one line as soon as a pause begins, and when playback continues."""
    agreed: Callable[[], bool] = lambda: True
    """Asked while units are cool; the pause lasts until it returns True."""

    def __post_init__(self) -> None:
        within(self.limit, "--cooling-limit", 0, 86400, unit="s", above=True)


def log_nothing(_event: str, _reason: str) -> None:
    """Log nothing: the order is not logged."""


class ArrayDevice(ABC):
    """A phased array that plays drives and is silent at all other times."""

    name: str
    """The name that it was opened with, such as ``virtual``."""
    array: TransducerArray
    """Its transducers; it refuses phases that were computed for another array."""
    simulated: bool = False
    gated: bool = True
    """True if the exposure profile is enforced; False only if no sound can be emitted and no real device is connected.

    Playback on a gated array is logged, and `midair stop` reaches it.
    """
    exclusive: str | None = None
    """Name of the lock that keeps other programs out while it is open, see `device_lock`; None if it can be shared."""
    streams: bool = False
    """True if it reads the frames of a drive during playback; for other arrays the drive is loaded into memory."""
    steps_a_turn: int = PHASE_STEPS
    """Number of steps per turn to which it rounds phases."""
    cooling: Cooling | None = None
    """How to wait for units that are too hot; None ends playback with TooHotError."""
    participant: str = ""
    """Person or code that the log states for every order; empty if unknown."""
    _order: StopGuard
    _entered: contextlib.ExitStack
    _plays: bool
    _allowed: Callable[[], None] | None
    _log: Callable[[str, str], None]
    _orders: list[tuple[ExposureProfile, float, dict[str, Any]]]
    _left: float

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Create the stop guard before a driver's `__init__` runs."""
        device = super().__new__(cls)
        device._order, device._entered, device._plays = StopGuard(), contextlib.ExitStack(), False
        device._allowed, device._log, device._orders, device._left = None, log_nothing, [], np.inf
        return device

    @abstractmethod
    def open(self) -> None:
        """Open the device; it is silent afterwards."""

    @abstractmethod
    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Emit every frame of a drive that `play` has checked; `play` silences afterwards.

        An implementation must start or continue sound only inside `sounding`.
        """

    @abstractmethod
    def silence(self) -> None:
        """Stop all sound immediately and return once it is silent; callable from any thread at any time."""

    @abstractmethod
    def close(self) -> None:
        """Close the device; no effect if not open."""

    def describe(self) -> dict[str, str]:
        """Device information while it is open, by name."""
        return {}

    def play(
        self,
        clearance: ExposureClearance,
        *,
        source: str | Path = "python",
        delay: float = 0.0,
        progress: Progress | None = None,
        watched: bool | None = None,
        room: Medium | None = None,
    ) -> PlayReport:
        """Play a checked drive from its first frame to its last, then silence the array, also after an error.

        On a gated array the order is logged before the first sound and its end after the last, and `midair stop` in
        another terminal silences the array.

        `clearance` is the result of `check_exposure` for this device; it includes the number of repeats, which follow
        without a gap. `source` names the drive in the log, where a file is hashed; `delay` is the silence in s before
        the first frame; `progress` is called with (frames begun, total frames). With `watched`, playback on an array
        that is not gated is logged and can be stopped too; a gated one always is. `room` is the air that the user
        stated, for the log. Raises MismatchError if the drive was checked for another array, InputError if the delay is
        out of range, DeviceStateError if `clearance` is no clearance or has no frames yet or the device is not open,
        StoppedError if `midair stop` was called, HeldError if another program uses the device, FileError if the log or
        the state folder cannot be written.
        """
        if not isinstance(clearance, ExposureClearance):  # pyright: ignore[reportUnnecessaryIsInstance]
            kind = type(clearance).__name__
            raise DeviceStateError(
                f"{self.name}: expected the result of check_exposure(), got a {kind}; nothing plays unchecked"
            )
        if not 0 <= delay < 3600:
            raise InputError(f"delay: expected 0 to 3600 s, got {delay:g} s")
        drive = clearance.check_for(self)

        entry: dict[str, Any] = {}
        logs = self._logged(clearance, source, room, entry) if self.gated or watched else contextlib.nullcontext()
        with logs:
            with self._playing():
                report = self.emit(drive, progress, repeats=clearance.repeats, delay=delay)
            entry |= asdict(report)
        return report

    @contextmanager
    def _logged(
        self, clearance: ExposureClearance, source: str | Path, room: Medium | None, entry: dict[str, Any]
    ) -> Generator[None]:
        """Log the order on entry and its end on exit, with the contents of `entry`; `midair stop` reaches it inside."""
        with self._order.held(self.name, self.exclusive, self.silence):
            self._order.check(self.name)
            number = log_order(
                source, self.name, clearance, simulated=self.simulated, room=room, participant=self.participant
            )
            self._log = partial(log_pause, number, source, self.name)
            profile, outcome = clearance.exposure.profile, cast("tuple[Ending, str]", ("played", ""))
            free, later = self.simulated or clearance.named, clearance.later
            # An array for which orders replace each other must not keep their drives.
            del clearance
            if not self._orders:
                self._left = np.inf if free else sound_left(profile, self.participant)
            self._orders.append((profile, time.monotonic(), entry))
            try:
                yield
                # A stop during the last block is not noticed inside `emit`.
                self._order.check(self.name)
            except BaseException as end:
                outcome = self._log_outcome(end)
                raise
            finally:
                self._log = log_nothing
                self._orders.pop()
                entry |= {"checked": exposed(later())} if later else {}
                log_end(number, source, self.name, *outcome, report=entry)

    def _check_hours(self) -> None:
        """Raise ExposureError if the sound of the open orders lasts for longer than their profile permits today."""
        now = time.monotonic()
        sounded = sum(float(entry.get("duration", now - began)) for _, began, entry in self._orders)
        if sounded > self._left:
            profile = self._orders[-1][0]
            raise hours_error(profile, self.participant, 3600 * profile.hours - self._left + sounded, 0.0)

    @contextmanager
    def _playing(self) -> Generator[None]:
        """Inside, `sounding` permits sound; it is silent afterwards, also after an error."""
        try:
            self._plays = True
            yield
        except BaseException:
            self._silence_after_an_error()
            raise
        finally:
            self._plays = False
        self.silence()

    @contextmanager
    def reserved(self) -> Generator[None]:
        """While inside, no other program gets the device, open or not, and `midair stop` reaches this one.

        After a stop nothing sounds until the outermost block ends. Entering the device reserves it; reserve it earlier
        if preparation, such as reading and checking a long drive, takes time.

        Raises HeldError if another program uses it, StoppedError if `midair stop` was called since the command was
        given, or is called inside, FileError if the state folder cannot be written.
        """
        if not self.gated:
            yield
            return
        with self._order.held(self.name, self.exclusive, self.silence):
            yield

    @contextmanager
    def sounding(self) -> Generator[None]:
        """Inside, a driver may start or continue sound; a stop waits until the block ends and then prevents any further
        sound.

        Raises StoppedError if `midair stop` was called, DeviceStateError if a gated array is used outside `play`, and
        any error of the check set by `allowing`.
        """
        if self.gated and not self._plays:
            raise DeviceStateError(
                f"{self.name}: expected play() with the result of check_exposure(); nothing sounds unchecked"
            )
        with self._order.sounding(self.name):
            if self._allowed is not None:
                self._allowed()
            yield

    def allowing(self, check: Callable[[], None] | None) -> None:
        """Set a function that is called before every frame or switch and raises if sound is not permitted."""
        self._allowed = check

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            stack.enter_context(self.reserved())
            self.open()
            stack.push(self._on_exit)
            self._entered = stack.pop_all()
        return self

    def __exit__(self, *error: Any) -> None:
        self._entered.__exit__(*error)

    def _on_exit(self, _: object, error: BaseException | None, __: object) -> None:
        try:
            if error is None:
                self.silence()
            else:
                self._silence_after_an_error()
        finally:
            self.close()

    def _log_outcome(self, end: BaseException) -> tuple[Ending, str]:
        """Outcome and reason of an exception that ended playback, for the log."""
        if self._order.stopped:
            return "stopped", "midair stop"
        # A key press or a signal is a request of the user as well.
        wished = isinstance(end, KeyboardInterrupt | SystemExit)
        return "stopped" if wished else "failed", f"{type(end).__name__}: {end}".rstrip(": ")

    def _silence_after_an_error(self) -> None:
        """Silence, but report the first error: after a lost connection, for example, silencing fails as well."""
        with contextlib.suppress(DeviceError):
            self.silence()
