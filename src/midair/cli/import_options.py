"""Options for files of other programs: channels, layout, footprint."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path as File
from types import MappingProxyType
from typing import Annotated, Any, get_args

from cyclopts import Parameter, Token

from midair.cli.quantities import format_quantity, parse_quantity, quantity
from midair.errors import InputError
from midair.files import ImportOptions, OpenedTake, open_take
from midair.model import Recording, SensorGrid, Unit
from midair.recordings import Footprint, Mending, Path, Shape, Turn, footprint_field, resample, suspicious
from midair.streaming import LazyFrames

Patch = tuple[str, float]
"""Shape and size (m) of a footprint."""


def parse_patch(text: str) -> Patch:
    """Shape and size in m of a text such as ``circle:20mm``."""
    shape, _, size = text.partition(":")
    if shape not in get_args(Shape) or not size:
        raise ValueError(f"expected SHAPE:SIZE such as circle:20mm, of {', '.join(get_args(Shape))}, got {text!r}")
    length = parse_quantity(size, "m")
    if length <= 0:
        raise ValueError(f"expected a size above 0, got {text!r}")
    return shape, length


def parse_layout(text: str) -> SensorGrid:
    """Sensor grid of a text such as ``4x4:11mm``: rows, columns, pitch."""
    found = re.fullmatch(r"([1-9]\d{0,3})x([1-9]\d{0,3}):(\S+)", text)
    if found is None:
        raise ValueError(f"expected ROWSxCOLUMNS:PITCH such as 4x4:11mm, got {text!r}")
    pitch = parse_quantity(found[3], "m")
    if pitch <= 0:
        raise ValueError(f"expected a pitch above 0, got {text!r}")
    return SensorGrid(rows=int(found[1]), columns=int(found[2]), pitch=pitch)


def parse_names(text: str) -> tuple[str, ...]:
    """Names or numbers separated by commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def parsed(parse: Callable[[str], Any], metavar: str) -> Parameter:
    """A command-line parameter of one word, read by `parse`."""

    def convert(_: Any, tokens: Sequence[Token]) -> Any:
        return parse(tokens[0].value)

    return Parameter(converter=convert, n_tokens=1, metavar=metavar, accepts_keys=False)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class FileOptions:
    """Properties that the file does not state.

    Parameters
    ----------
    rate
        Frame rate.
    unit
        Unit of the samples.
    scale
        Pressure per unit of the file, such as 30Pa: per full scale, per volt, per 1 m/s2.
    channels
        Channels to read, by name or by number from 0, separated by commas: accel_x, or 3,2,1,0.
    stream
        Which of several to read: a stream of XDF, a group of TDMS, a topic of MCAP, an array of NPZ or MAT.
    packed
        Number of channels that are interleaved in one row of numbers, such as 16.
    layout
        Rows, columns and pitch of the cells, such as 4x4:11mm.
    resample
        Resample to this rate, such as 1kHz.
    footprint
        Make a field from one channel: a circle, square or line of this size moves over the sensor, such as circle:20mm.
    speed
        Speed of the footprint over the sensor; negative reverses it, 0 keeps it in place.
    path
        Direction of the footprint: x, y or diagonal.
    turn
        When the footprint has left the sensor: stop, move back, or move over it again.
    """

    rate: Annotated[float | None, quantity("Hz")] = None
    unit: Unit | None = None
    scale: Annotated[float | None, quantity("Pa")] = None
    channels: Annotated[tuple[str, ...] | None, parsed(parse_names, "NAMES")] = None
    stream: str | None = None
    packed: int | None = None
    layout: Annotated[SensorGrid | None, parsed(parse_layout, "LAYOUT")] = None
    resample: Annotated[float | None, quantity("Hz")] = None
    footprint: Annotated[Patch | None, parsed(parse_patch, "SHAPE:SIZE")] = None
    speed: Annotated[float, quantity("m/s"), Parameter(allow_leading_hyphen=True)] = 50e-3
    path: Path = "x"
    turn: Turn = "stop"

    @property
    def changes(self) -> bool:
        """Whether the options change the samples."""
        return self.footprint is not None or self.resample is not None


AS_TYPED: Mapping[str, str] = MappingProxyType(
    {
        "give it, such as rate=1000 (Hz)": "give it, such as --rate 1000Hz",
        'give unit="V", "count" or "Pa"': "give --unit V, count or Pa",
        "such as scale=2 (Pa)": "such as --scale 2Pa",
        "give sensor=SensorGrid(rows=..., columns=..., pitch=...)": "give --layout ROWSxCOLUMNS:PITCH such as 4x4:11mm",
        "channels=(...)": "--channels 0,1",
        "(channels=)": "(--channels 0)",
    }
)
"""Phrases of the library for Python, and the same for the command line."""


def command_line_message(message: str) -> str:
    """A message of the library with command-line options instead of Python arguments."""
    for python, typed in AS_TYPED.items():
        message = message.replace(python, typed)
    return re.sub(r"got (rate|unit|scale)=", r"got --\1 ", message)


def import_recording(
    file: File, options: FileOptions, *, streamed: bool = False, mending: Mending | None = None
) -> OpenedTake:
    """The recording in a file and the assumptions made; lazy frames if `streamed`, unless gaps are filled."""
    try:
        return _read_with_options(file, options, streamed=streamed, mending=mending)
    except InputError as wrong:
        raise type(wrong)(command_line_message(str(wrong))) from wrong


def _read_with_options(file: File, options: FileOptions, *, streamed: bool, mending: Mending | None) -> OpenedTake:
    shared = [field.name for field in fields(ImportOptions) if hasattr(options, field.name)]
    facts = {name: getattr(options, name) for name in shared}
    layout = None if options.footprint else options.layout
    taken = open_take(file, **facts, sensor=layout, mending=mending, streamed=streamed)
    recording, report = taken.recording, taken.report
    if isinstance(recording.samples, LazyFrames):
        report = (*report, *suspicious(recording))
    if options.resample is not None:
        recording = resample(recording, options.resample)
    if options.footprint is not None:
        recording, more = _field(recording, options, options.footprint)
        report = (*report, *more)
    if options.changes:
        return OpenedTake(recording=recording, report=report)
    return replace(taken, recording=recording, report=report)


def _field(recording: Recording, options: FileOptions, patch: Patch) -> tuple[Recording, tuple[str, ...]]:
    shape, size = patch
    known = next(each for each in get_args(Shape) if each == shape)
    footprint = Footprint(shape=known, size=size, speed=options.speed, path=options.path, turn=options.turn)
    sensor = options.layout or SensorGrid()
    field = footprint_field(recording, footprint, sensor)
    how = f"A {shape} of {format_quantity(size, 'm')} at {options.speed * 1e3:g} mm/s"
    report = [f"{how} makes a synthetic field from one channel: positions were not measured."]
    crossing = footprint.crossing(sensor)
    if options.turn == "stop" and crossing < recording.duration:
        report.append(
            f"It leaves the sensor after {crossing:.3g} of {recording.duration:.3g} s, and the rest is silent; "
            "use --turn back or --turn again, or remove the rest with midair trim."
        )
    return field, tuple(report)
