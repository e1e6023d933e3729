"""The separate process of live touch, so that no file, page or person can delay its loop; a recording as its source."""

import os
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, fields
from multiprocessing.connection import Connection

import numpy as np
from numpy.typing import NDArray

from midair.devices import (
    Chunk,
    Cooling,
    LeaseToken,
    PlayLease,
    SensorDevice,
    Source,
    Stream,
    StreamedSensor,
    ordered_at,
    process_start_time,
)
from midair.errors import DeviceError, DeviceStateError, InputError, MidairError, StoppedError
from midair.model import Calibration, SensorGrid, SensorWiring, Unit
from midair.rig.live_touch.live_loop import LiveLoop, LiveSteering
from midair.rig.live_touch.live_settings import LiveSchedule, LiveSettings
from midair.rig.live_touch.timing import request_realtime
from midair.rig.live_touch.touch import Rehearsal, Touch
from midair.rig.live_touch.touch_ring import TouchRing
from midair.rig.names.sensor_names import VirtualRig, open_tracker, sensor_named
from midair.rig.opening import OpenRig, frame_rig
from midair.rig.playing.following import tracker_name
from midair.rig.playing.play_settings import PlaySettings, RigSettings
from midair.rig.session import Session
from midair.settings import Settings
from midair.solvers import one_blas_thread


class RepeatedSource(Source):
    """Repeats `samples`, shape (frame, channel), in real time, in blocks of `block` frames as a converter does."""

    def __init__(self, samples: NDArray[np.float64], stream: Stream, *, block: int = 2) -> None:
        self._samples, self._stream, self._block = samples, stream, block
        self._begin = 0.0
        self._next = 0

    def open(self) -> Stream:
        """Return the stream."""
        return self._stream

    def start(self) -> None:
        """Start with the first frame now."""
        self._begin, self._next = time.monotonic(), 0

    def pull(self, wait: float) -> Chunk | None:
        """Return the next block when its last frame is due."""
        first, rate = self._next, self._stream.rate
        left = self._begin + (first + self._block) / rate - time.monotonic()
        if left > wait:
            time.sleep(wait)
            return None
        time.sleep(max(0.0, left))
        self._next += self._block
        at = np.arange(first, first + self._block) % len(self._samples)
        # Time stamp of the end of the frame.
        taken = self._begin + (first + 1) / rate
        return Chunk(samples=self._samples[at], first=first, device_time=first / rate, host_time=taken)

    def describe(self) -> dict[str, str]:
        """Duration of the period."""
        return {"round": f"{len(self._samples) / self._stream.rate:g} s, repeated"}


def streamed(sensor: SensorDevice, *, longest: float = 30.0) -> StreamedSensor:
    """Return a live sensor; record an on-demand one (virtual or replayed) for `longest` seconds and repeat it.

    DeviceStateError if the sensor is neither.
    """
    if isinstance(sensor, StreamedSensor):
        return sensor
    if not sensor.on_demand:
        raise DeviceStateError(f"{sensor.name}: expected a live sensor, or one that can be repeated")
    with sensor:
        sensor.start()
        block = sensor.read(round(longest * sensor.rate))
    samples = np.asarray(block.samples).reshape(len(block.samples), -1)
    stream = Stream(channels=sensor.grid.count, rate=sensor.rate, unit=sensor.unit, stored=sensor.stored)
    wiring = SensorWiring(grid=sensor.grid, unit=sensor.unit, full_scale=sensor.full_scale)
    made = StreamedSensor(RepeatedSource(samples, stream), name=sensor.name, wire=lambda _: wiring)
    made.calibration, made.simulated = sensor.calibration, sensor.simulated
    return made


RATES = (100.0, 2000.0)
"""Frame rates in Hz for live touch: below, no vibration is felt; above, a frame takes longer to compute than it lasts.
"""

ROUND = 3.0
"""Duration of a virtual sensor's touch in s, which is repeated."""

NOTES = 300
"""Most lines of a run that are sent to the program that started it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopStarted:
    """State of the opened devices, sent once before the first frame."""

    sensor: SensorGrid
    unit: Unit
    """Unit of the samples: "V", "count" or "Pa"."""
    rate: float
    """Frame rate of the sensor in Hz."""
    schedule: LiveSchedule
    """Times, mapping, and frames of the array for each of the sensor."""
    calibration: Calibration
    """Calibration of the sensor."""
    simulated: bool
    """Whether sensor or array is simulated."""
    transducers: int
    exposure: str
    """Verdict of the exposure check."""
    level: float
    """Cleared level."""
    strongest: int
    """Its intensity byte."""
    granted: str
    """Real-time rights that the computer granted."""
    rehearsal: Rehearsal
    """Frames that were computed in real time before the start."""
    delay: float
    """Delay of filter and mapping in s."""
    parts: tuple[tuple[float, float], ...]
    """Parts of the band in Hz."""
    error: tuple[float, ...]
    """Error of the causal inverse in each part; empty without one."""
    silencer: str
    """How the units spread phase steps."""
    array_calibration: str
    """Calibration of the array that is solved for, with its age; empty without one."""


def play_live(order: LiveSettings, ring: TouchRing, lease: PlayLease, token: LeaseToken, told: Connection) -> None:
    """Run the process: open the devices, check the exposure, report, play while lease and token hold, report the end.

    `told` receives one `LoopStarted`, then a line for each begin and end of a pause or of following, and the error that
    ended the run, or None.
    """
    # Ctrl-C also reaches the parent process, which ends this one in order; `midair stop` sends it too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    error: MidairError | None = None
    try:
        with ordered_at(process_start_time()), one_blas_thread():
            _play(order, ring, lease, token, told)
    except MidairError as wrong:
        error = wrong
    except KeyboardInterrupt:
        error = StoppedError(f"{order.device}: stopped by a key")
    except Exception as wrong:  # noqa: BLE001  # reported to the parent process
        error = DeviceError(f"live: this is an error in midair, please report it: {type(wrong).__name__}: {wrong}")
    with suppress(OSError):  # the parent process may be gone
        told.send(error)


def _play(order: LiveSettings, ring: TouchRing, lease: PlayLease, token: LeaseToken, told: Connection) -> None:
    named = sensor_named(order.sensor, VirtualRig(seed=order.seed), duration=ROUND, wiring=order.wiring)
    sensor, notes = streamed(named, longest=ROUND), 0

    def note(text: str) -> None:
        nonlocal notes
        # A program that reads no lines must not stop the loop.
        if (notes := notes + 1) <= NOTES:
            told.send(text)

    # Before the SDK starts its threads, which inherit the priority.
    granted = request_realtime(order.priority)
    with sensor:
        if not RATES[0] <= sensor.rate <= RATES[1]:
            raise InputError(
                f"{sensor.name}: expected {RATES[0]:g} to {RATES[1]:g} frames per second, got {sensor.rate:g} Hz; "
                "state a rate with ?rate=1000"
            )
        calibration = calibration_for(order, sensor)
        schedule = order.schedule(sensor.rate)
        rate = schedule.formed * sensor.rate
        with live_rig(order, sensor.rate, note) as rig, ExitStack() as opened:
            array, kept, solved = rig.frames, rig.measured, rig.transducers
            clearance = Session(rig=rig).clear_level(order.level, rate)
            touch = Touch(order, calibration, sensor.grid, sensor.rate, solved, clearance.level)
            rehearsal = touch.rehearse(rate, schedule.hold)
            # The kernel stops real-time threads that filled a core for a second, as this start does, for 50 ms.
            for _ in range(2):
                if rehearsal.late:
                    rehearsal = touch.rehearse(rate, schedule.hold)
            known = "" if kept is None else kept.described(Settings().but(acoustics=order.acoustics, grid=order.grid))
            told.send(
                LoopStarted(
                    sensor=sensor.grid,
                    unit=sensor.unit,
                    rate=sensor.rate,
                    schedule=schedule,
                    calibration=calibration,
                    simulated=sensor.simulated or array.simulated,
                    transducers=array.array.count,
                    exposure=clearance.verdict(),
                    level=clearance.level,
                    strongest=clearance.strongest,
                    granted=granted,
                    rehearsal=rehearsal,
                    delay=touch.delay,
                    parts=() if touch.error is None else tuple(touch.parts),
                    error=() if touch.error is None else tuple(float(each) for each in touch.error),
                    silencer=str(array.silencer),
                    array_calibration=known,
                )
            )
            steering = None
            if order.follow is not None:
                tracker = opened.enter_context(open_tracker(tracker_name(order.follow, order.tracker_latency)))
                steering = LiveSteering(tracker, array.array, rate, order, note)
                tracker.begin(time.monotonic())
            loop = LiveLoop(
                sensor,
                touch,
                array,
                ring,
                strongest=clearance.strongest,
                level=lambda: lease.level,
                check=_lease_check(lease, token, array.name),
                steering=steering,
            )
            source_name, room = f"live {sensor.name}", order.exposure.room
            with array.frames_to_come(clearance, source=source_name, room=room) as put:
                sensor.start()
                loop.run(put, order.duration)


def _lease_check(lease: PlayLease, token: LeaseToken, name: str) -> Callable[[], None]:
    parent = os.getppid()

    def check() -> None:
        lease.check(token, name)
        if os.getppid() != parent:
            raise StoppedError(f"{name}: stopped, since the program that started it is gone; start again")

    return check


def calibration_for(order: LiveSettings, sensor: StreamedSensor) -> Calibration:
    """Calibration of a sensor.

    InputError if a sensor gives volts or counts without a calibration, or its cells do not fit.
    """
    known = order.calibration or sensor.calibration
    if known is None and sensor.unit != "Pa":
        raise InputError(
            f"{sensor.name}: expected a calibration, since the sensor gives {sensor.unit}, got none; give its "
            "file with --calibration, or its ?sensitivity="
        )
    if known is not None and known.sensor.shape != sensor.grid.shape:
        raise InputError(
            f"calibration: expected one of {sensor.grid.rows} x {sensor.grid.columns} cells, got one of "
            f"{known.sensor.rows} x {known.sensor.columns}"
        )
    return known or Calibration.flat(sensor.grid, unit="Pa")


def live_rig(order: LiveSettings, rate: float, report: Callable[[str], object] = bool) -> OpenRig:
    """The rig of the settings for a sensor of a rate in Hz, not yet open; `report` gets a line a pause of hot units."""
    schedule = order.schedule(rate)
    cooling = None if order.cooling_limit is None else Cooling(limit=order.cooling_limit, report=report)
    shared = {one.name: getattr(order, one.name) for one in fields(RigSettings)}
    return frame_rig(PlaySettings(**shared, cooling=cooling), schedule.formed * rate, hold=schedule.ahead)
