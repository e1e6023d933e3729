"""Options for files of other programs, and stated calibrations: --sensitivity, --peak."""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path as File
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import numpy as np
from cyclopts import Parameter, Token

from midair import files
from midair.cli.console import err
from midair.cli.options import format_quantity, options_from, parse_quantity, quantity
from midair.errors import InputError, MismatchError
from midair.evaluate import PEOPLE, felt
from midair.model import Calibration, Provenance, Recording, SensorGrid, Unit
from midair.recordings import Footprint, Mending, Path, Shape, Turn, footprint_field, resample

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


def resampled(recording: Recording, rate: float) -> Recording:
    """A recording at another rate; InputError for one that its use does not need."""
    low, high = 40.0, 1e6
    if 0 < rate < low:
        raise InputError(f"rate: expected {low:g} Hz or more, twice the lowest frequency in use, got {rate:g} Hz")
    if rate > high:
        raise InputError(f"rate: expected at most {high / 1e6:g} MHz, got {rate / 1e6:g} MHz; is the unit right?")
    return resample(recording, rate)


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


ChannelNumbers = Annotated[tuple[str, ...], parsed(parse_names, "NUMBERS")]
"""Numbers of channels, separated by commas."""


def channel_numbers(names: tuple[str, ...], recording: Recording) -> tuple[int, ...]:
    """Numbers of channels of a recording; InputError for one that it does not have."""
    count = recording.sensor.count
    wrong = [name for name in names if not name.isdecimal() or int(name) >= count]
    if wrong:
        raise InputError(f"channels: expected comma-separated numbers from 0 to {count - 1}, got {', '.join(wrong)}")
    return tuple(int(name) for name in names)


SOUND_RATE = 4000.0
"""Highest rate in Hz of a channel that becomes a field, unless another one is stated; skin feels up to 1 kHz."""

FELT: Mapping[str, float] = MappingProxyType({"soft": 0.0, "medium": PEOPLE, "strong": 2 * PEOPLE})
"""Level of each strength over the detection threshold of half of all people, in dB."""


@options_from(files.ImportOptions)
@dataclass(frozen=True, slots=True, kw_only=True)
class FileOptions:
    """Properties that the file does not state."""

    channels: Annotated[tuple[str, ...] | None, parsed(parse_names, "NAMES")] = None
    """Channels to read, by name or by number from 0, separated by commas: accel_x, or 3,2,1,0."""
    layout: Annotated[SensorGrid | None, parsed(parse_layout, "LAYOUT")] = None
    """Rows, columns and pitch of the cells, such as 4x4:11mm."""
    felt: Literal["soft", "medium", "strong"] | None = None
    """Choose --scale so that about 5, 8 or 9 of 10 people feel it, by the model of skin."""
    resample: Annotated[float | None, quantity("Hz")] = None
    """Resample to this rate, such as 1kHz. [default: at most 4kHz with --footprint]"""
    footprint: Annotated[Patch | None, parsed(parse_patch, "SHAPE:SIZE")] = None
    """Make a field from one channel: a shape of this size moves over the sensor: circle:20mm, square:, line:."""
    speed: Annotated[float, quantity("m/s"), Parameter(allow_leading_hyphen=True)] = 50e-3
    """Speed of the footprint over the sensor; negative reverses it, 0 keeps it in place."""
    path: Path = "x"
    """Path of the footprint: x, y, diagonal, or a circle within the sensor."""
    turn: Turn = "stop"
    """When the footprint has left the sensor: stop, move back, or move over it again."""


TYPED: Mapping[str, str] = MappingProxyType(
    {
        "rate": "--rate 1000Hz",
        "unit": "--unit V, count or Pa",
        "scale": "--felt medium, or --scale 1Pa, the pressure of the value 1",
        "sensor": "--layout ROWSxCOLUMNS:PITCH such as 4x4:11mm",
        "channels": "--channels 0 to choose one",
        "transpose": "--transpose if its last axis is time",
        "decimal": "--decimal comma, or point",
    }
)
"""Options for parameters of `open_take` that errors advise to give."""


def import_recording(file: File, options: FileOptions, *, mending: Mending | None = None) -> files.OpenedTake:
    """The recording in a file and the assumptions made."""
    if options.felt is not None:
        plain = replace(options, felt=None, scale=1.0)
        found = import_recording(file, plain, mending=mending).recording
        level = felt(found.samples, found.rate, found.sensor.pitch).level
        if not np.isfinite(level):
            raise InputError(f"--felt: expected a recording that vibrates, got {file} without vibration")
        scale = float(f"{10 ** ((FELT[options.felt] - level) / 20):.3g}")
        return import_recording(file, replace(plain, scale=scale), mending=mending)
    try:
        shared = [field.name for field in fields(files.ImportOptions) if hasattr(options, field.name)]
        facts = {name: getattr(options, name) for name in shared}
        layout = None if options.footprint else options.layout
        taken = files.open_take(file, **facts, sensor=layout, mending=mending)
        recording, report = taken.recording, taken.report
        rate, own = options.resample, recording.rate
        if rate is None and options.footprint is not None and own > SOUND_RATE:
            rate = SOUND_RATE
            report = (*report, f"Resampled to 4 kHz; skin feels no difference. Keep the file's: --resample {own:g}Hz.")
        if rate is not None:
            recording = resampled(recording, rate)
        if options.footprint is not None:
            recording, more = _field(recording, options, options.footprint)
            report = (*report, *more)
        if options.footprint is not None or rate is not None:
            return files.OpenedTake(recording=recording, report=report)
        return replace(taken, recording=recording, report=report)
    except InputError as wrong:
        raise type(wrong)(wrong.message(TYPED)) from wrong


def ask_missing(
    file: File, options: FileOptions, mending: Mending | None, *, ask: bool, counts: bool
) -> files.OpenedTake:
    """Import; with `ask` on a terminal, ask for each missing fact (Enter: the proposal), but not for `counts`."""
    while True:
        try:
            return import_recording(file, options, mending=mending)
        except InputError as wrong:
            cause = wrong.__cause__
            first = cause.args[0] if isinstance(cause, InputError) and not cause.parameters else cause
            facts = first.parameters if isinstance(first, InputError) else {}
            known = next((each for each in _QUESTIONS if each in facts), None)
            if known == "unit" and counts:
                options = replace(options, unit="count")
                continue
            if not ask or known is None or not (sys.stdin.isatty() and err().is_terminal):
                raise
            question, proposed, parse = _QUESTIONS[known]
            said = str(first).partition("; give ")[0].removeprefix(f"{file}: ")
            shown = f"{said[0].upper()}{said[1:]}.\n{question} [{proposed}]: "
            try:
                options = replace(options, **parse(err().input(shown, markup=False).strip() or proposed))
            except ValueError as fault:
                err().print(f"{fault}")


def _unit_or_scale(text: str) -> dict[str, Any]:
    return {"unit": text} if text in get_args(Unit) else {"scale": parse_quantity(text, "Pa")}


def _cells(text: str) -> dict[str, Any]:
    return {"layout": parse_layout(text)} if ":" in text else {"channels": parse_names(text)}


_QUESTIONS: Mapping[str, tuple[str, str, Callable[[str], dict[str, Any]]]] = MappingProxyType(
    {
        "rate": ("Frame rate", "1000Hz", lambda text: {"rate": parse_quantity(text, "Hz")}),
        "unit": ("Unit: V, count, Pa, or the pressure of the value 1 such as 30Pa", "V", _unit_or_scale),
        "scale": ("Pressure of the value 1", "1Pa", lambda text: {"scale": parse_quantity(text, "Pa")}),
        "sensor": ("Channels to read, or ROWSxCOLUMNS:PITCH such as 4x4:11mm for all", "0", _cells),
    }
)
"""Question, proposed answer and parser of each fact that `open_take` may lack."""


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
            f"It has left the palm after {crossing:.3g} of {recording.duration:.3g} s; let it come back: --turn back; "
            "start again: --turn again; remove the silent rest: midair trim."
        )
    return field, tuple(report)


def calibration_from_options(recording: Recording, sensitivity: str | None, peak: float | None) -> Calibration | None:
    """Calibration of a stated sensitivity or peak (Pa); None if neither is given."""
    if sensitivity is not None and peak is not None:
        raise MismatchError("expected --sensitivity or --peak, got both; state one")
    if sensitivity is not None:
        if recording.unit == "Pa":
            raise InputError("--sensitivity: the recording is in Pa already; leave it out")
        value = stated_sensitivity(sensitivity, f"{recording.unit}/Pa", "--sensitivity")
        return Calibration.flat(recording.sensor, sensitivity=value, unit=recording.unit)
    if peak is None:
        return None
    change = np.abs(recording.samples - np.median(recording.samples, axis=0)).max()
    if change == 0 or not 0 < peak <= 1e5:
        raise InputError(
            f"--peak: expected a pressure above 0 and at most 100000 Pa, and a recording that changes, "
            f"got {peak:g} Pa, {change:g}"
        )
    flat = Calibration.flat(recording.sensor, sensitivity=float(change / peak), unit=recording.unit)
    stated = f"stated: the largest change of any channel, {change:.4g} {recording.unit}, is {peak:g} Pa"
    return replace(flat, provenance=Provenance(source=stated))


def stated_sensitivity(text: str, unit: str, option: str) -> float:
    """Value of an option in `unit`; InputError if it is no such quantity."""
    try:
        return parse_quantity(text, unit)
    except ValueError as wrong:
        raise InputError(f"{option}: {wrong}") from None
