"""What a sensor and an array can do, whoever made them.

A device is a context manager: entering opens it, leaving stops and closes it, and leaving an array silences it first,
on errors too. A new device is a subclass in a file of its own that fills in the abstract methods.
"""

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from midair.devices.exposure_check import ExposureClearance
from midair.devices.frame_bytes import PHASE_STEPS
from midair.devices.safety import Ending, StopGuard, log_end, log_order
from midair.errors import DeviceError, DeviceStateError, InputError
from midair.lazy_frames import Stored
from midair.model import Calibration, Drive, Medium, Progress, SensorGrid, SensorWiring, TransducerArray, Unit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrameBlock:
    """Consecutive frames as a sensor gave them.

    Attributes
    ----------
    samples : ndarray, shape (frame, row, column)
        In the sensor's unit.
    first : int
        Index of the first frame since start; a gap to the block before is lost frames.
    device_time : float
        Of the first frame by the device's own clock, in s: its time stamp, or else frames counted over its rate.
    host_time : float
        Of the first frame by this computer's steady clock (`time.monotonic`), in s, as well as the source tells. The
        slope of one time over the other is the drift of the device's clock. A virtual sensor gives its own time twice.
    overflow : bool
        Whether frames were lost before this block.
    """

    samples: NDArray[np.float64]
    first: int
    device_time: float
    host_time: float
    overflow: bool = False

    def __repr__(self) -> str:
        lost = ", after lost frames" if self.overflow else ""
        return f"<FrameBlock {len(self.samples)} frames from {self.first} at {self.device_time:.3f} s{lost}>"


class SensorDevice(ABC):
    """A pressure sensor that gives blocks of frames.

    Attributes
    ----------
    name : str
        What it was opened by, such as ``virtual:towel``.
    grid : SensorGrid
        Its cells.
    rate : float
        Frames per second, in Hz.
    unit : {"V", "count", "Pa"}
        Of its samples.
    calibration : Calibration or None
        That it brings along.
    simulated : bool
        Whether what it gives is simulated.
    full_scale : float or None
        Magnitude in `unit` at which it clips, where that is known.
    wiring : SensorWiring or None
        Which channel of its source is which cell, where it has a source with channels.
    on_demand : bool
        Whether its time stands still while nobody reads, as that of a replayed file does.
    stored : {"f4", "f8"}
        Whether float32 holds every number that it gives.
    """

    name: str
    grid: SensorGrid
    rate: float
    unit: Unit
    calibration: Calibration | None = None
    simulated: bool = False
    full_scale: float | None = None
    wiring: SensorWiring | None = None
    on_demand: bool = False
    stored: Stored = "f8"

    @abstractmethod
    def open(self) -> None:
        """Take hold of the device."""

    @abstractmethod
    def start(self) -> None:
        """Begin to sample: frame 0 is the first one after this."""

    @abstractmethod
    def read(self, frames: int) -> FrameBlock:
        """The next frames, `frames` of them; fewer before a gap and at the end, none when the source has ended.

        Raises
        ------
        DeviceStateError
            If it was not started.
        DeviceError
            If it gives nothing for longer than it may, or is lost; frames that came before are given first.
        """

    @abstractmethod
    def stop(self) -> None:
        """End sampling. Harmless when not started."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. Harmless when not open."""

    def describe(self) -> dict[str, str]:
        """What it says of itself, and what it counted since start, in words."""
        return {}

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        self.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayReport:
    """What an array did with a drive.

    Attributes
    ----------
    frames : int
        That it played, all repeats counted.
    duration : float
        From the first frame to the end of the last, less gaps, in s.
    late : int
        Frames that began later than their time.
    repeated : int
        Frames that stood longer than their time.
    start : int or None
        Device time of the first frame in ns, the same on all units; None where there is no such clock.
    gap : float
        Silence that came between frames, in s.
    silencer : str
        How the firmware spread steps, in words; empty where there is none.
    units : str
        How the units were while they played, in words; empty where they cannot be asked.
    """

    frames: int
    duration: float
    late: int = 0
    repeated: int = 0
    start: int | None = None
    gap: float = 0.0
    silencer: str = ""
    units: str = ""


class ArrayDevice(ABC):
    """A phased array that plays drives and is silent at all other times.

    Attributes
    ----------
    name : str
        What it was opened by, such as ``virtual``.
    array : TransducerArray
        Its transducers; it plays phases made for them and refuses others.
    simulated : bool
        Whether it only pretends.
    gated : bool
        Whether nothing may be played on it that breaks the exposure profile; False only where no sound can come out
        and no real device is spoken to. What plays on a gated array is logged, and `midair stop` reaches it.
    exclusive : str or None
        What no other program may have while this one is open, see `device_lock`; None where each program gets its own.
    streams : bool
        Whether it takes a drive whose frames are read while it plays; others get it in memory.
    steps_a_turn : int
        Of a turn, to which it rounds phases.
    """

    name: str
    array: TransducerArray
    simulated: bool = False
    gated: bool = True
    exclusive: str | None = None
    streams: bool = False
    steps_a_turn: int = PHASE_STEPS
    _order: StopGuard
    _entered: contextlib.ExitStack
    _plays: bool
    _allowed: Callable[[], None] | None

    def __new__(cls, *_: Any, **__: Any) -> Self:
        """Every array has its order from the beginning, whatever a driver's __init__ does."""
        made = super().__new__(cls)
        made._order, made._entered, made._plays = StopGuard(), contextlib.ExitStack(), False
        made._allowed = None
        return made

    @abstractmethod
    def open(self) -> None:
        """Take hold of the device; it is silent."""

    @abstractmethod
    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Put out every frame of a drive that `play` has checked; `play` silences afterwards.

        Whatever lets sound begin, or go on, does so inside `sounding`.
        """

    @abstractmethod
    def silence(self) -> None:
        """Stop all sound at once, and return when it has; from any thread, harmless at any time."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. Harmless when not open."""

    def describe(self) -> dict[str, str]:
        """What it says of itself while it is open, in words."""
        return {}

    def play(
        self,
        admission: ExposureClearance,
        *,
        source: str | Path = "python",
        delay: float = 0.0,
        progress: Progress | None = None,
        watched: bool | None = None,
        room: Medium | None = None,
    ) -> PlayReport:
        """Play what was admitted from its first frame to its last, then be silent, whatever happens on the way.

        On an array that can be heard the order is in the log before the first sound, and its end after the last; and
        `midair stop` in another terminal silences it.

        Parameters
        ----------
        admission : Admission
            From `admit` with this device; it says how often, one time after the other without a gap.
        source : str or Path
            What to call it in the log; a file is hashed there.
        delay : float
            Silence before the first frame, in s.
        progress : callable, optional
            Called with (frames begun, frames in all).
        watched : bool, optional
            Whether it is logged and can be stopped from elsewhere, on an array that nobody can hear. Any other always
            is, and such a one is not if None.
        room : Medium, optional
            The air that somebody stated, for the log.

        Raises
        ------
        MismatchError
            If it was admitted for another array.
        InputError
            If the delay is negative or endless.
        DeviceStateError
            If it is no admission, or one for frames that are yet to come, or the device is not open.
        StoppedError
            If somebody asked for silence.
        HeldError
            If another program has the device.
        FileError
            If the log or the state folder cannot be written.
        """
        if not isinstance(admission, ExposureClearance):  # pyright: ignore[reportUnnecessaryIsInstance]
            kind = type(admission).__name__
            raise DeviceStateError(
                f"{self.name}: expected an admission from admit(), got a {kind}; nothing plays unchecked"
            )
        if not 0 <= delay < 3600:
            raise InputError(f"delay: expected 0 to 3600 s, got {delay:g} s")
        drive = admission.check_for(self)

        def emitted() -> PlayReport:
            try:
                self._plays = True
                report = self.emit(drive, progress, repeats=admission.repeats, delay=delay)
            except BaseException:
                self._silence_after_an_error()
                raise
            finally:
                self._plays = False
            self.silence()
            return report

        if not (self.gated or watched):
            return emitted()
        with self._order.held(self.name, self.exclusive, self.silence):
            self._order.check(self.name)
            number = log_order(source, self.name, admission, simulated=self.simulated, room=room)
            try:
                report = emitted()
                # The last block of a drive needs no order any more that could have been refused.
                self._order.check(self.name)
            except BaseException as end:
                log_end(number, source, self.name, *self._ended(end))
                raise
            log_end(number, source, self.name, "played", report=asdict(report))
        return report

    @contextmanager
    def reserved(self) -> Generator[None]:
        """While inside, open or not yet, no other program gets the device, and `midair stop` reaches this one.

        After such a stop nothing sounds until the outermost block is left. Entering the device reserves it; earlier is
        better where what comes before, such as reading and checking a long drive, takes its time.

        Raises
        ------
        HeldError
            If another program has it.
        StoppedError
            If somebody asked for silence since the command was given, or does so meanwhile.
        FileError
            If the state folder cannot be written.
        """
        if not self.gated:
            yield
            return
        with self._order.held(self.name, self.exclusive, self.silence):
            yield

    @contextmanager
    def sounding(self) -> Generator[None]:
        """Inside, a driver lets sound begin or go on: nobody silences meanwhile, and nothing begins after a stop.

        Raises
        ------
        StoppedError
            If somebody asked for silence.
        DeviceStateError
            If this is not `play`, where it can be heard.
        MidairError
            Whatever the check of `allowing` raises.
        """
        if self.gated and not self._plays:
            raise DeviceStateError(f"{self.name}: expected play() with an admission; nothing sounds unchecked")
        with self._order.sounding(self.name):
            if self._allowed is not None:
                self._allowed()
            yield

    def allowing(self, check: Callable[[], None] | None) -> None:
        """Have something called before every frame or switch, which raises where nothing may sound."""
        self._allowed = check

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            stack.enter_context(self.reserved())
            self.open()
            stack.push(self._shut)
            self._entered = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._entered.__exit__(kind, error, trace)

    def _shut(self, _: type[BaseException] | None, error: BaseException | None, __: TracebackType | None) -> None:
        try:
            if error is None:
                self.silence()
            else:
                self._silence_after_an_error()
        finally:
            self.close()

    def _ended(self, end: BaseException) -> tuple[Ending, str]:
        """How an exception that ended playing stands in the log."""
        if self._order.stopped:
            return "stopped", "midair stop"
        # A key or a signal is somebody's wish as well.
        wished = isinstance(end, KeyboardInterrupt | SystemExit)
        return "stopped" if wished else "failed", f"{type(end).__name__}: {end}".rstrip(": ")

    def _silence_after_an_error(self) -> None:
        """Silence, and let the first error be the one that is told: a lost link, say, cannot be told to be silent."""
        with contextlib.suppress(DeviceError):
            self.silence()
