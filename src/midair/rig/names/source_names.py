"""Live sensors by name: ``lsl:Skin``, ``audio:USB?channels=16``, ``serial:COM3?baud=2000000``, ``ni:Dev1/ai0:15``.

Options come after a question mark. All kinds know those of `SourceOptions`; the others are below.
"""

import importlib
import re
from collections.abc import Callable, Mapping
from typing import Any, cast, get_args

from pydantic import BaseModel, ConfigDict, PositiveFloat, PositiveInt, ValidationError

from midair.devices import Decimated, Source, Stream, StreamedSensor
from midair.errors import DeviceError, InputError, MissingExtraError
from midair.model import SensorGrid, SensorWiring, Unit


class SourceOptions(BaseModel):
    """What any live sensor can be told after the question mark.

    Attributes
    ----------
    unit, full_scale, sensitivity, rows, columns, pitch_mm
        As in a sensor file, which they override.
    rate : float, optional
        Rate of the frames, in Hz; a faster source is filtered and thinned out.
    timeout : float
        After how many seconds without a frame the sensor counts as lost.
    """

    model_config = ConfigDict(extra="forbid")

    unit: Unit | None = None
    full_scale: PositiveFloat | None = None
    sensitivity: float | None = None
    rows: PositiveInt | None = None
    columns: PositiveInt | None = None
    pitch_mm: PositiveFloat | None = None
    rate: PositiveFloat | None = None
    timeout: PositiveFloat = 2.0

    def wire(self, stream: Stream, wiring: SensorWiring | None, name: str) -> SensorWiring:
        """The sensor: what is stated here, else what the sensor file says, else what the stream is."""
        base = wiring or SensorWiring.for_channels(stream.channels, name=name, unit=stream.unit or "count")
        rows, columns = self.rows or base.grid.rows, self.columns or base.grid.columns
        pitch = base.grid.pitch if self.pitch_mm is None else self.pitch_mm * 1e-3
        # An order that was stated for other cells means nothing for these.
        same = (rows, columns) == base.grid.shape
        return SensorWiring(
            grid=SensorGrid(rows=rows, columns=columns, pitch=pitch, name=base.grid.name),
            order=base.order if same else (),
            unit=self.unit or base.unit,
            full_scale=self.full_scale or base.full_scale,
            sensitivity=self.sensitivity or base.sensitivity,
        )


class LslOptions(SourceOptions):
    """Further options of ``lsl:``, as in `LslSource`."""

    source_id: str | None = None
    counter: int | None = None
    search: PositiveFloat = 5.0


class AudioOptions(SourceOptions):
    """Further options of ``audio:``: channels, and the converter's own rate in Hz. Frames come at 1 kHz if not told."""

    rate: PositiveFloat | None = 1000.0
    channels: PositiveInt | None = None
    native: PositiveFloat | None = None


class SerialOptions(SourceOptions):
    """Further options of ``serial:``: bits per second."""

    baud: PositiveInt = 921_600


class NiOptions(SourceOptions):
    """Further options of ``ni:``: the converter's own rate in Hz, the largest voltage, against what it is measured."""

    native: PositiveFloat | None = None
    limit: PositiveFloat = 10.0
    wires: str = "default"


def source_sensor(name: str, *, wiring: SensorWiring | None = None) -> StreamedSensor:
    """The live sensor that a name means, not yet open.

    Parameters
    ----------
    name : str
        KIND:WHERE or KIND:WHERE?option=value&option=value.
    wiring : SensorWiring, optional
        Wiring from its sensor file.

    Raises
    ------
    MissingExtraError
        If the package that the kind needs is not installed.
    DeviceError
        If that package lacks a library.
    InputError
        If an option is unknown or cannot be used.
    """
    kind, where, said = split_name(name)
    options = _options(name, _OPTIONS[kind], said)
    module = source_module(kind)
    source = _decimated(_SOURCES[kind](module, where, cast(Any, options)), options)
    plain = f"{kind}:{where}"
    return StreamedSensor(
        source,
        name=name,
        wire=lambda stream: options.wire(stream, wiring, plain),
        # At a low rate even a healthy sensor is silent for longer than the limit.
        timeout=max(options.timeout, 3 / (options.rate or 1e9)),
    )


def split_name(name: str) -> tuple[str, str, dict[str, str]]:
    """Kind, place and options of a name."""
    # A question mark that no option follows belongs to the place.
    match = re.fullmatch(r"([^:]*):(.*?)(?:\?((?:\w+=[^&?]*&)*\w+=[^&?]*))?", name, re.DOTALL)
    if match is None:
        return name, "", {}
    pairs = (pair.split("=", 1) for pair in (match[3] or "").split("&") if pair)
    return match[1], match[2], dict(pairs)


def source_module(kind: str) -> Any:
    """The driver's file; loading it loads its package.

    Raises
    ------
    MissingExtraError, DeviceError
        If the package, or a library that it needs, is not there.
    """
    try:
        return importlib.import_module(f"midair.devices.sensors.{_MODULES[kind]}")
    except ModuleNotFoundError as wrong:
        raise MissingExtraError(
            f'{kind}: expected the package {wrong.name}, it is not installed; pip install "midair[{kind}]"'
        ) from wrong
    except (OSError, RuntimeError) as wrong:
        raise DeviceError(f"{kind}: expected {_LIBRARIES[kind]}, got: {str(wrong).splitlines()[0]}") from wrong


_MODULES = {"lsl": "lsl", "audio": "audio", "serial": "serial_port", "ni": "ni"}

_LIBRARIES = {
    "lsl": "the library liblsl, which comes with the package pylsl on common systems",
    "audio": "the library PortAudio (Debian: apt-get install libportaudio2)",
    "serial": "the package pyserial",
    "ni": "the vendor's driver NI-DAQmx",
}
"""What each kind needs beside its package."""

_OPTIONS: Mapping[str, type[SourceOptions]] = {
    "lsl": LslOptions,
    "audio": AudioOptions,
    "serial": SerialOptions,
    "ni": NiOptions,
}

KINDS = tuple(_OPTIONS)
"""Kinds of live sensors."""


def _lsl(module: Any, where: str, options: LslOptions) -> Source:
    return module.LslSource(where, source_id=options.source_id, counter=options.counter, search=options.search)


def _audio(module: Any, where: str, options: AudioOptions) -> Source:
    return module.AudioSource(where, channels=options.channels, rate=options.native)


def _serial(module: Any, where: str, options: SerialOptions) -> Source:
    return module.SerialSource(where, baud=options.baud)


def _ni(module: Any, where: str, options: NiOptions) -> Source:
    if options.wires not in get_args(module.Wires):
        raise InputError(f"ni: expected wires={' or '.join(get_args(module.Wires))}, got {options.wires!r}")
    rate = options.native or options.rate or 1000.0
    return module.NiSource(where, rate=rate, limit=options.limit, wires=options.wires)


_SOURCES: Mapping[str, Callable[[Any, str, Any], Source]] = {
    "lsl": _lsl,
    "audio": _audio,
    "serial": _serial,
    "ni": _ni,
}


def _decimated(source: Source, options: SourceOptions) -> Source:
    return source if options.rate is None else Decimated(source, options.rate)


def _options(name: str, kind: type[SourceOptions], said: Mapping[str, str]) -> SourceOptions:
    try:
        return kind.model_validate(dict(said))
    except ValidationError as wrong:
        first = wrong.errors()[0]
        option = ".".join(str(part) for part in first["loc"])
        known = ", ".join(kind.model_fields)
        if first["type"] == "extra_forbidden":
            raise InputError(f"{name}: expected the options {known}, got {option}") from None
        raise InputError(f"{name}: option {option}: {first['msg']}, got {said.get(option, '')!r}") from None
