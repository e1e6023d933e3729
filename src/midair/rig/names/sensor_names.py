"""Sensors by name: ``virtual:towel``, ``replay:take.h5``, ``lsl:Skin``, ``audio:USB?channels=16``, ``ni:Dev1/ai0:15``.

Options follow a question mark; each kind of live sensor has those of `SensorOptions` and its own. Motion stages are
``grbl:/dev/ttyUSB0`` or ``grbl:COM3?baud=115200``, trackers of the palm ``leap:``, ``lsl:Palm``, ``osc:9000`` or
``replay:hand.csv?latency_ms=20``. The virtual rig is an array, a sensor, and the air between them.
"""

import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from midair.datasets import am_stimulus, stroke, taps
from midair.devices import (
    Decimated,
    GrblStage,
    RawPose,
    ReplaySensor,
    ReplaySource,
    SensorDevice,
    SensorOptions,
    StreamedSensor,
    Tracker,
    TrackerOptions,
    VirtualArray,
    VirtualSensor,
    VirtualSkin,
    WrappedSensor,
    usual_transducers,
)
from midair.errors import BandError, BrokenFileError, InputError, UnknownDeviceError, did_you_mean
from midair.files import json_of, load_palm_path, load_tracker, open_take, read_text
from midair.model import (
    HEIGHT,
    HEIGHTS,
    RATE,
    Acoustics,
    PalmPath,
    PressureFrames,
    SensorGrid,
    SensorWiring,
    TrackerPlacement,
    TransducerArray,
)
from midair.physics import PlaybackChain, SensorModel, TransducerDynamics, Transducers
from midair.registry import Registry, load_object
from midair.settings import TransducerSpread
from midair.validation import check_settings, checked_call, length, setting, within

SPREADS: Mapping[TransducerSpread, Mapping[str, float]] = MappingProxyType(
    {
        # Assumed: 5 % of strength, 50 Hz, 5 % of quality; phases then differ by 0.06 rad.
        "default": {},
        # Phases differ by 0.2 rad, the median over 33 boards of OpenMPD whose files state a measured phase for each of
        # 256 transducers (RMResearch/OpenMPD, OpenMPD_Client/board_*.pat), without a quadratic trend over the board.
        "boards": {"resonance_spread": 180.0},
        # 40.0 +- 1.0 kHz (Pro-Wave 400PT120, Changzhou FHD), taken as three standard deviations; strength assumed.
        "data-sheets": {"resonance_spread": 1000.0 / 3, "gain_spread": 0.1},
    }
)
"""Changes of `usual_transducers` for each spread."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualRig:
    """Parameters of a simulated rig; the sensor lies face down over the centre of the array."""

    array: TransducerArray = field(default_factory=TransducerArray.autd3)
    cells: SensorGrid = field(default_factory=SensorGrid)
    height: float = HEIGHT
    """Height of the sensor above the array in m."""
    acoustics: Acoustics | None = None
    """Air during playback, whatever a drive was solved for, and directivity; each drive's own air if None."""
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    rate: float = RATE
    """Rate of the sensor in Hz."""
    steps: int = 8
    """Simulation steps per frame of the sensor."""
    seed: int = 0
    """Seed of the sensor's spread and noise and of the transducers' strengths."""
    spread: TransducerSpread = "default"
    """Differences between the transducers."""
    transducers: Transducers | None = None
    """Transducers of the array, such as from `Transducers.measured`; a random spread if None."""
    reflection: complex = 0.0
    """Reflection factor of the array's face, for the echo of a palm or of a plate around the sensor, 85 mm wide."""
    palm: PalmPath | None = None
    """Poses of the sensor during each play, in array coordinates; it rests over the centre of the array if None."""
    peak: float = 30.0
    """Peak pressure of a modulated focus in Pa; at 30 Pa two corrected foci stay within the array's power."""

    def __post_init__(self) -> None:
        length(self.height, "height", HEIGHTS)
        within(abs(self.reflection), "reflection", 0, 1)
        if self.palm is not None and (away := self.palm.normal[:, 2] >= 0).any():
            at = f"faces away from the array at {self.palm.time[away.argmax()]:g} s"
            raise InputError(f"palm path: the palm {at}; a normal of (0, 0, -1) faces it")

    @property
    def sensor_model(self) -> SensorModel:
        """The sensor, with a random spread of its channels."""
        cells = replace(self.cells, name=f"virtual sensor {self.seed}")
        return SensorModel.usual(cells).with_spread(seed=self.seed)

    def hearing(self, band: tuple[float, float]) -> "VirtualRig":
        """Return the rig with a sensor rate high enough for a band: at 1 kHz up to 487 Hz, at 8 kHz up to 3.9 kHz.

        BandError if the band exceeds that.
        """
        for rate in (1e3, 2e3, 4e3, 8e3):
            if 2.05 * band[1] <= rate:
                chosen = max(rate, self.rate)
                return replace(self, rate=chosen, steps=max(2, round(self.rate * self.steps / chosen)))
        raise BandError(
            f"band: expected one up to 3900 Hz, the limit of the virtual sensor, got {band[0]:g} to {band[1]:g} Hz"
        )

    def skin(self) -> VirtualSkin:
        """Surface that carries the sensor."""
        return VirtualSkin(self.sensor_model, height=self.height, rate=self.rate * self.steps)

    def sensor(self, skin: VirtualSkin, *, touch: PressureFrames | None = None, name: str = "virtual") -> VirtualSensor:
        """Make the sensor on its surface, touched from the start if `touch` is given."""
        return VirtualSensor(skin, touch=touch, rate=self.rate, seed=self.seed, name=name)

    def array_device(self, skin: VirtualSkin | None = None) -> VirtualArray:
        """Make the array, whose sound presses on the surface."""
        drawn = self.transducers or usual_transducers(
            self.array.count, self.dynamics, seed=self.seed, **SPREADS[self.spread]
        )
        how: dict[str, Any] = {"acoustics": self.acoustics, "palm": self.palm, "reflection": self.reflection}
        return VirtualArray(self.array, skin, chain=PlaybackChain(transducers=drawn), **how)

    def touched_by(self, thing: str, *, duration: float | None = None) -> VirtualSensor:
        """Make the sensor with a simulated touch from the start, for some seconds.

        ``brush``, ``sponge`` or ``towel``, each with ``+groove`` for the grooved surface; ``am-i``, ``am-ii`` or
        ``am-iii``; or ``taps``, on each cell in turn; UnknownDeviceError for other names. Without a duration a whole
        stroke, or half a second of a modulated focus.
        """
        skin = self.skin()
        touch = self._touch(thing, skin, duration)
        return self.sensor(skin, touch=touch, name=f"virtual:{thing}")

    def _touch(self, thing: str, skin: VirtualSkin, duration: float | None) -> PressureFrames:
        grid = skin.model.grid
        match thing.partition("+"):
            case ("brush" | "sponge" | "towel" as name, _, "" | "groove" as surface):
                # Only silence follows, which the skin appends.
                longest = None if duration is None else min(duration, 10.0)
                return stroke(name, groove=bool(surface), seed=self.seed, rate=skin.rate, duration=longest, sensor=grid)
            case ("am-i" | "am-ii" | "am-iii" as name, "", ""):
                number: Literal["i", "ii", "iii"] = "i" if name == "am-i" else "ii" if name == "am-ii" else "iii"
                return am_stimulus(number, peak=self.peak, duration=duration or 0.5, rate=skin.rate, sensor=grid)
            case ("taps", "", ""):
                return taps(seed=self.seed, rate=skin.rate, sensor=grid)
            case _:
                near = did_you_mean(thing, ("brush", "sponge", "towel", "am-i", "am-ii", "am-iii", "taps"))
                raise UnknownDeviceError(
                    "virtual sensor: expected brush, sponge or towel (+groove or not), am-i, am-ii, am-iii or taps, "
                    f"got {thing!r}{near}"
                )


Options = TypeVar("Options", bound=SensorOptions | TrackerOptions)

SENSORS: Registry[type[SensorOptions]] = Registry(
    "midair.sensors",
    {
        "lsl": "midair.devices.sensors.lsl:LslSensor [lsl]",
        "audio": "midair.devices.sensors.audio:AudioSensor [audio]",
        "serial": "midair.devices.sensors.serial_port:SerialSensor [serial]",
        "ni": "midair.devices.sensors.ni:NiSensor [ni]",
    },
)
"""Kinds of live sensors."""


def source_sensor(name: str, *, wiring: SensorWiring | None = None) -> StreamedSensor:
    """Make the live sensor that a name stands for, not yet open.

    MissingExtraError if its package is not installed, DeviceError if the package lacks a library, InputError if an
    option is unknown or invalid.
    """
    kind, place, stated = split_name(name)
    options = checked_options(name, SENSORS[kind], stated)
    source = options.source(place)
    plain = f"{kind}:{place}"
    return StreamedSensor(
        source if options.rate is None else Decimated(source, options.rate),
        name=name,
        wire=lambda stream: options.wire(stream, wiring, plain),
        # At a low rate the frame interval of a working sensor can exceed the limit.
        timeout=max(options.timeout, 3 / (options.rate or 1e9)),
    )


def split_name(name: str) -> tuple[str, str, dict[str, str]]:
    """Split a name into kind, place and options."""
    # A question mark without an option after it belongs to the place.
    match = re.fullmatch(r"([^:]*):(.*?)(?:\?((?:\w+=[^&?]*&)*\w+=[^&?]*))?", name, re.DOTALL)
    if match is None:
        return name, "", {}
    pairs = (pair.split("=", 1) for pair in (match[3] or "").split("&") if pair)
    return match[1], match[2], dict(pairs)


def checked_options(name: str, kind: type[Options], stated: Mapping[str, str]) -> Options:
    """The options of a name; InputError if one is unknown or invalid."""
    known, types = [one.name for one in fields(kind)], get_type_hints(kind)
    values: dict[str, Any] = {}
    for option, text in stated.items():
        if option not in known:
            raise InputError(f"{name}: expected the options {', '.join(known)}, got {option}")
        wanted = next((each for each in get_args(types[option]) if get_origin(each) is Literal), types[option])
        words = get_args(wanted) if get_origin(wanted) is Literal else ()
        number = next((each for each in (int, float) if each in (wanted, *get_args(wanted))), None)
        try:
            values[option] = text if number is None else number(text)
        except ValueError:
            raise InputError(f"{name}: option {option}: expected a number, got {text!r}") from None
        if words and text not in words:
            raise InputError(f"{name}: option {option}: expected {', '.join(words)}, got {text!r}")
    made = kind(**values)
    try:
        check_settings(made)
    except InputError as wrong:
        raise InputError(f"{name}: option {wrong}") from None
    return made


def sensor_named(
    name: str, rig: VirtualRig, *, duration: float | None = None, wiring: SensorWiring | None = None
) -> SensorDevice:
    """Make the sensor that a name stands for, not yet open.

    ``virtual:OBJECT`` is an object of `VirtualRig.touched_by` for `duration` s, ``replay:FILE`` a recording; live
    sensors are ``lsl:NAME``, ``audio:DEVICE``, ``serial:PORT``, ``ni:CHANNELS``. `wiring` assigns channels to cells;
    cells of a virtual or replayed sensor count as channels. UnknownDeviceError if the name is unknown; others as in
    `source_sensor`.
    """
    kind, _, rest = name.partition(":")
    if kind not in ("virtual", "replay") and kind in SENSORS and (rest or SENSORS[kind].has_default):
        return source_sensor(name, wiring=wiring)
    made = _on_demand_sensor(kind, rest, name, rig, duration)
    return made if wiring is None else WrappedSensor(made, wiring)


def _on_demand_sensor(kind: str, rest: str, name: str, rig: VirtualRig, duration: float | None) -> SensorDevice:
    if kind == "virtual" and rest:
        return rig.touched_by(rest, duration=duration)
    if kind == "replay" and rest:
        take = open_take(rest)
        return ReplaySensor(take.recording, calibration=take.calibration, name=name)
    others = "".join(f"{kind}:PLACE, " for kind in SENSORS.others)
    near = f"replay:{name}" if name.endswith(".h5") else "audio:" if name in ("mic", "microphone") else "virtual:towel"
    raise UnknownDeviceError(
        f"sensor: expected virtual:OBJECT, replay:FILE, {others}lsl:NAME, audio:DEVICE, serial:PORT or ni:CHANNELS, "
        f"got {name!r}; try {near}"
    )


def stage_named(name: str) -> GrblStage:
    """Make the motion stage that a name stands for, not yet open.

    ``grbl:PORT`` is a machine with Grbl 1.1 at a serial port; ``?baud=`` if its rate is not 115200 bits per second.
    UnknownDeviceError, InputError or MissingExtraError if the name is unknown, an option is invalid, or pyserial is not
    installed.
    """
    kind, place, stated = split_name(name)
    if not place or kind != "grbl":
        raise UnknownDeviceError(f"--stage: expected grbl:PORT, such as grbl:/dev/ttyUSB0, got {name!r}")
    baud = stated.pop("baud", "115200")
    if stated or not baud.isdecimal() or not int(baud):
        got = next(iter(stated), f"baud={baud}")
        raise InputError(f"{name}: expected the option baud, bits per second, got {got}")
    return GrblStage(place, baud=int(baud))


TRACKERS = {
    "leap": "midair.devices.trackers.leap:LeapTracker [leap]",
    "lsl": "midair.devices.trackers.lsl_poses:LslTracker [lsl]",
    "osc": "midair.devices.trackers.osc:OscTracker",
    "replay": "midair.rig.names.sensor_names:ReplayTracker",
}
"""Kinds of trackers; each is imported when it is first used."""


@dataclass(frozen=True, kw_only=True)
class ReplayTracker(TrackerOptions):
    """Kind ``replay:FILE``: a file of poses; `latency_ms` delays them."""

    # A hand-made path may hold still.
    freeze: float = setting(0.0, "As of a live tracker.", unit="s", limits=(0, np.inf))

    def source(self, place: str) -> ReplaySource:
        """Poses of a file: CSV, or a list of frames of Ultraleap's service in JSON."""
        palm = _leap_recording(place) if place.lower().endswith(".json") else load_palm_path(place)
        return ReplaySource(palm, latency=self.latency_ms * 1e-3)


def _leap_recording(path: str) -> PalmPath:
    """Poses of frames of the protocol version 6, as a list or under the key "frames"; time 0 is the first pose."""
    try:
        content = json_of(read_text(path, "a list of frames in JSON"))
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected a list of frames in JSON, got: {wrong}") from wrong
    reader = load_object("leap", "midair.devices.trackers.leap:LeapFrames [leap]")()
    read = [reader.read(frame) for frame in (content["frames"] if isinstance(content, dict) else content)]
    poses = [pose for pose in read if isinstance(pose, RawPose)]
    if not poses:
        raise BrokenFileError(f"{path}: expected frames with a hand, got none")
    rows = np.array([[pose.stamp - poses[0].stamp, *pose.values, pose.confidence] for pose in poses])
    try:
        return PalmPath.from_rows(rows)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def tracker_options(name: str) -> tuple[TrackerOptions, str]:
    """Options and place of a tracker's name; UnknownDeviceError or InputError if it is unknown, or has wrong ones."""
    kind, place, stated = split_name(name)
    if kind not in TRACKERS:
        raise UnknownDeviceError(f"tracker: expected {', '.join(f'{each}:PLACE' for each in TRACKERS)}, got {name!r}")
    return checked_options(name, load_object(kind, TRACKERS[kind]), stated), place


@checked_call
def open_tracker(
    name: str,
    *,
    placement: TrackerPlacement | str | os.PathLike[str] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Tracker:
    """Open a tracker of the palm; close it, or leave its ``with`` block.

    UnknownDeviceError, InputError, MissingExtraError or DeviceError if the name is unknown, an option is invalid, a
    package is missing, or the tracker does not answer.

    Parameters
    ----------
    placement : TrackerPlacement or path, optional
        How the tracker lies relative to the array; by default their coordinates are the same.
    clock : callable
        Clock of all times, for simulations.
    """
    options, place = tracker_options(name)
    if placement is not None and not isinstance(placement, TrackerPlacement):
        placement = load_tracker(placement)
    source = options.source(place)
    if isinstance(source, ReplaySource):
        source.clock = clock
    tracker = Tracker(source, name=name, options=options, placement=placement, clock=clock)
    tracker.open()
    return tracker
