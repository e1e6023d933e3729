"""What a person says about a file that they bring: its channels, its layout, its footprint."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as File
from types import MappingProxyType
from typing import Annotated, Any, get_args

from cyclopts import Parameter, Token

from midair.cli.terminal.quantities import parse_quantity, quantity, spell
from midair.errors import InputError
from midair.files import OpenedTake, open_take
from midair.lazy_frames import LazyFrames
from midair.model import Recording, SensorGrid, Unit
from midair.recordings import Footprint, Mending, Path, Shape, Turn, footprint_field, resample, suspicious

Patch = tuple[str, float]
"""Shape and size (m) of a footprint."""


def parse_patch(text: str) -> Patch:
    """Shape and size, in m, that a text such as ``circle:20mm`` means.

    Raises
    ------
    ValueError
        If it means none.
    """
    shape, _, size = text.partition(":")
    if shape not in get_args(Shape) or not size:
        raise ValueError(f"expected SHAPE:SIZE such as circle:20mm, of {', '.join(get_args(Shape))}, got {text!r}")
    length = parse_quantity(size, "m")
    if length <= 0:
        raise ValueError(f"expected a size above 0, got {text!r}")
    return shape, length


def parse_layout(text: str) -> SensorGrid:
    """The sensor that a text such as ``4x4:11mm`` means: rows, columns, and the distance between cells.

    Raises
    ------
    ValueError
        If it means none.
    """
    found = re.fullmatch(r"([1-9]\d{0,3})x([1-9]\d{0,3}):(\S+)", text)
    if found is None:
        raise ValueError(f"expected ROWSxCOLUMNS:PITCH such as 4x4:11mm, got {text!r}")
    pitch = parse_quantity(found[3], "m")
    if pitch <= 0:
        raise ValueError(f"expected a pitch above 0, got {text!r}")
    return SensorGrid(rows=int(found[1]), columns=int(found[2]), pitch=pitch)


def parse_names(text: str) -> tuple[str, ...]:
    """Names or numbers with commas between them."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def parsed(parse: Callable[[str], Any], metavar: str) -> Parameter:
    """A command line parameter of one word that `parse` reads."""

    def convert(_: Any, tokens: Sequence[Token]) -> Any:
        return parse(tokens[0].value)

    return Parameter(converter=convert, n_tokens=1, metavar=metavar, accepts_keys=False)


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class FileOptions:
    """What the file does not say.

    Parameters
    ----------
    rate
        Frames per second.
    unit
        Of the samples.
    scale
        Pressure that 1 of the file's numbers means, such as 30Pa: of full scale, of a volt, of 1 m/s2.
    channels
        The ones to take, by name or by number from 0, with commas: accel_x, or 3,2,1,0.
    stream
        Which one to take of several: a stream of XDF, a group of TDMS, a topic of MCAP, an array of NPZ or MAT.
    packed
        So many channels stand one after another in one row of numbers, frame behind frame, such as 16.
    layout
        How the cells lie, such as 4x4:11mm.
    resample
        Change the rate, such as to 1kHz.
    footprint
        Make a field of one channel: a circle, square or line of this size, such as circle:20mm, touches the sensor.
    speed
        At which the footprint moves over the sensor; negative from the other side, 0 to stay.
    path
        Along which it moves: x, y or diagonal.
    turn
        What it does when it has left the sensor: stop, back or again.
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
        """Whether the samples that come out are not the file's."""
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
"""What the library says to Python, and what a person types instead."""


def as_typed(message: str) -> str:
    """A message of the library in the words of the command line."""
    for python, typed in AS_TYPED.items():
        message = message.replace(python, typed)
    return re.sub(r"got (rate|unit|scale)=", r"got --\1 ", message)


def import_recording(
    file: File, options: FileOptions, *, streamed: bool = False, mending: Mending | None = None
) -> OpenedTake:
    """The recording in a file, as the options make it, and what was assumed on the way.

    With `streamed` its samples may be a reel, as in `open_take`; what is mended is not.
    """
    try:
        return _brought(file, options, streamed=streamed, mending=mending)
    except InputError as wrong:
        raise type(wrong)(as_typed(str(wrong))) from wrong


def _brought(file: File, options: FileOptions, *, streamed: bool, mending: Mending | None) -> OpenedTake:
    taken = open_take(
        file,
        rate=options.rate,
        unit=options.unit,
        sensor=None if options.footprint else options.layout,
        scale=options.scale,
        channels=options.channels,
        stream=options.stream,
        packed=options.packed,
        mending=mending,
        streamed=streamed,
    )
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
    how = f"A {shape} of {spell(size, 'm')} at {options.speed * 1e3:g} mm/s"
    report = [f"{how} makes a synthetic field of one channel: its places were never measured."]
    crossing = footprint.crossing(sensor)
    if options.turn == "stop" and crossing < recording.duration:
        report.append(
            f"It leaves the sensor after {crossing:.3g} of {recording.duration:.3g} s, and nothing touches after that; "
            "--turn back or again goes on, midair trim cuts the rest."
        )
    return field, tuple(report)
