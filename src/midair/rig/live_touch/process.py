"""The process in which live touch runs, alone with its loop: no file, no page and no person can hold it up."""

import os
import signal
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from types import MappingProxyType
from typing import Any

from midair.devices import (
    ExposureClearance,
    ImmediateArray,
    StreamedSensor,
    autd3_immediate,
    check_exposure_level,
    ordered_at,
    process_began,
    virtual_immediate,
)
from midair.errors import DeviceError, InputError, MidairError, StoppedError, UnknownDeviceError
from midair.model import Calibration, Medium, SensorGrid, Unit
from midair.rig.live_touch.live_loop import LiveLoop
from midair.rig.live_touch.live_settings import RATES, LiveSettings
from midair.rig.live_touch.receiving import NetworkSource
from midair.rig.live_touch.repeated import streamed
from midair.rig.live_touch.timing import SchedulerGrant, request_realtime
from midair.rig.live_touch.touch import Touch
from midair.rig.live_touch.touch_ring import TouchRing
from midair.rig.names import VirtualRig, sensor_named
from midair.rig.play_lease import LeaseToken, PlayLease
from midair.solvers import one_blas_thread

ROUND = 3.0
"""Of a virtual sensor's touch, which is repeated, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopStarted:
    """What the process found when its devices were open: said once, before the first frame.

    Attributes
    ----------
    sensor : SensorGrid
        Its cells.
    unit : {"V", "count", "Pa"}
        Of its samples.
    rate : float
        Frames per second, in Hz.
    calibration : Calibration or None
        Of the sensor, or that it had none.
    simulated : bool
        Whether sensor or array is not real.
    transducers, units : int
        Of the array.
    exposure : str
        The verdict of the level's admission.
    level : float
        That was admitted.
    strongest : int
        Its intensity byte.
    granted : Granted
        What the computer granted.
    delay : float
        Of the filter and the mapping, in s.
    parts : tuple of tuple of float
        Of the band, in Hz.
    error : tuple of float
        Of the causal inverse in each of them; empty where there is none.
    silencer : str
        How the units spread steps.
    described : dict of str to str
        What the units say of themselves.
    """

    sensor: SensorGrid
    unit: Unit
    rate: float
    calibration: Calibration | None
    simulated: bool
    transducers: int
    units: int
    exposure: str
    level: float
    strongest: int
    granted: SchedulerGrant
    delay: float
    parts: tuple[tuple[float, float], ...]
    error: tuple[float, ...]
    silencer: str
    described: dict[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEnded:
    """How a run ended.

    Attributes
    ----------
    error : MidairError or None
        By what; None if it was its time, or somebody ended it.
    told : dict of str to int
        What became of all frames on their way to the units.
    network : dict of str to int
        What came over a network, and what became of it; empty where nothing did.
    """

    error: MidairError | None
    told: dict[str, int]
    network: dict[str, int] = field(default_factory=dict[str, int])


def _viewed(known: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(known)


def _as_dict(view: MappingProxyType[Any, Any]) -> tuple[Any, ...]:
    """A read-only view of a dict, which pickle does not know, as what it is made of."""
    return _viewed, (dict(view),)


# Between processes go calibrations, whose provenance has such views.
ForkingPickler.register(MappingProxyType, _as_dict)


def play_live(order: LiveSettings, ring: TouchRing, permit: PlayLease, leave: LeaseToken, told: Connection) -> None:
    """What the process does: open, admit, say what was found, play, say how it ended.

    Parameters
    ----------
    order : LiveOrder
        What and how.
    ring : TouchRing
        Where every frame is written down.
    permit, leave
        While they hold, something may sound.
    told : Connection
        Takes one `LoopStarted` and one `LoopEnded`, or an `LoopEnded` alone.
    """
    # Ctrl-C of the terminal is for whoever started this, who then ends it in order; `midair stop` sends one too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    counted: dict[str, int] = {}
    network: dict[str, int] = {}
    error: MidairError | None = None
    try:
        with ordered_at(process_began()), one_blas_thread():
            _play(order, ring, permit, leave, told, counted, network)
    except MidairError as wrong:
        error = wrong
    except KeyboardInterrupt:
        error = StoppedError(f"{order.device}: stopped by a key")
    except Exception as wrong:  # noqa: BLE001  # a process has nobody above it: whoever started it is told
        error = DeviceError(f"live: this is an error in midair, please report it: {type(wrong).__name__}: {wrong}")
    with suppress(OSError):  # nobody is there any more
        told.send(LoopEnded(error=error, told=counted, network=network))


def _play(
    order: LiveSettings,
    ring: TouchRing,
    permit: PlayLease,
    leave: LeaseToken,
    told: Connection,
    counted: dict[str, int],
    network: dict[str, int],
) -> None:
    sensor, source = sensor_for(order)
    # Before the SDK starts threads of its own, which then have it too.
    granted = request_realtime(order.priority)
    with sensor:
        check_rate(sensor)
        calibration = calibration_for(order, sensor)
        with array_for(order, sensor.rate) as array:
            admission = check_exposure_level(order.level, array, order.exposure, rate=sensor.rate)
            touch = Touch(order.touch, calibration, sensor.grid, sensor.rate, array.array, admission.level)
            if source is not None:
                touch.delay += source.delay
            told.send(_found(sensor, calibration, array, admission, touch, granted))
            loop = LiveLoop(
                sensor,
                touch,
                array,
                ring,
                pace=order.pace,
                strongest=admission.strongest,
                level=lambda: permit.level,
                check=_checks(permit, leave, array.name),
            )
            try:
                with (
                    array.frames_to_come(admission, source=f"live {sensor.name}", room=room_of(order)) as put,
                    _running(sensor),
                ):
                    loop.run(put, order.duration)
            finally:
                counted |= array.units.told()
                if source is not None:
                    network |= asdict(source.counted)


def _checks(permit: PlayLease, leave: LeaseToken, name: str) -> Callable[[], None]:
    parent = os.getppid()

    def check() -> None:
        permit.check(leave, name)
        if os.getppid() != parent:
            raise StoppedError(f"{name}: silenced, for the program that looked on is gone; start again")

    return check


@contextmanager
def _running(sensor: StreamedSensor) -> Generator[None]:
    sensor.start()
    try:
        yield
    finally:
        sensor.stop()


def check_rate(sensor: StreamedSensor) -> None:
    """Refuse a rate at which nothing can be played live."""
    if not RATES[0] <= sensor.rate <= RATES[1]:
        raise InputError(
            f"{sensor.name}: expected {RATES[0]:g} to {RATES[1]:g} frames per second, got {sensor.rate:g} Hz; "
            "state a rate with ?rate=1000"
        )


def room_of(order: LiveSettings) -> Medium | None:
    """The air of the room, where somebody stated it."""
    medium = order.touch.acoustics.medium
    return None if medium.temperature is None else medium


def sensor_for(order: LiveSettings) -> tuple[StreamedSensor, NetworkSource | None]:
    """The sensor of an order, not yet open; and where its frames come from, if that is a network."""
    if order.listen is None:
        named = sensor_named(order.sensor, VirtualRig(seed=order.seed), duration=ROUND, wiring=order.wiring)
        return streamed(named, longest=ROUND), None
    heard = order.listen
    source = NetworkSource((heard.host, heard.port), heard.key, buffer=heard.buffer)
    return StreamedSensor(source, name=order.sensor, wire=lambda _: source.wiring), source


def calibration_for(order: LiveSettings, sensor: StreamedSensor) -> Calibration | None:
    """The calibration that undoes a sensor; None where it gives pressure already.

    Raises
    ------
    InputError
        If it gives volts or counts and nobody knows what they mean.
    """
    if order.listen is not None:
        return None
    known = order.calibration or sensor.calibration
    if known is None and sensor.unit != "Pa":
        raise InputError(
            f"{sensor.name}: expected a calibration of a sensor that gives {sensor.unit}, got none; give its "
            "file with --calibration, or its ?sensitivity="
        )
    if known is not None and known.sensor.shape != sensor.grid.shape:
        raise InputError(
            f"calibration: expected one of {sensor.grid.rows} x {sensor.grid.columns} cells, got one of "
            f"{known.sensor.rows} x {known.sensor.columns}"
        )
    return known or Calibration.flat(sensor.grid, unit="Pa")


def array_for(order: LiveSettings, rate: float) -> ImmediateArray:
    """The array of an order, not yet open.

    Raises
    ------
    UnknownDeviceError
        If it takes no single frames.
    """
    kind, _, where = order.device.partition(":")
    if order.device == "virtual":
        return virtual_immediate(order.placement, hold=order.pace.hold)
    if kind == "autd3":
        return autd3_immediate(
            where or "auto", order.placement, silencer=order.silencer, rate=rate, hold=order.pace.hold
        )
    raise UnknownDeviceError(
        "live: expected virtual, autd3, autd3:INTERFACE or autd3:emulator, whose units take single frames with their "
        f"instant, got {order.device!r}; others play recordings: midair play"
    )


def _found(
    sensor: StreamedSensor,
    calibration: Calibration | None,
    array: ImmediateArray,
    admission: ExposureClearance,
    touch: Touch,
    granted: SchedulerGrant,
) -> LoopStarted:
    return LoopStarted(
        sensor=sensor.grid,
        unit=sensor.unit,
        rate=sensor.rate,
        calibration=calibration,
        simulated=sensor.simulated or array.simulated,
        transducers=array.array.count,
        units=array.placement.units,
        exposure=admission.verdict(),
        level=admission.level,
        strongest=admission.strongest,
        granted=granted,
        delay=touch.delay,
        parts=() if touch.error is None else tuple(touch.parts),
        error=() if touch.error is None else tuple(float(each) for each in touch.error),
        silencer=str(array.silencer),
        described=array.describe(),
    )
