"""Options that several commands share; those of the settings are declared in `settings.CHOICES`.

A quantity is a number with a unit, such as 200mm, 20Hz or .5s.
"""

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, dataclass, field, fields, make_dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, TypeVar, cast, get_origin, get_type_hints

from cyclopts import Group, Parameter, Token

from midair import files
from midair.errors import InputError
from midair.model import HEIGHTS, Directivity, Palm
from midair.settings import CHOICES, MODES, Mode, Settings, TransducerSpread, format_value
from midair.solvers import QuietPalm
from midair.validation import Declared

EXAMPLES = {
    "m": "200mm",
    "Hz": "20Hz",
    "s": "0.5s",
    "Pa": "30Pa",
    "count/Pa": "2count/Pa",
    "V/Pa": "20mV/Pa",
    "m/s": "50mm/s",
    "C": "22C",
    "K": "2C",
    "%": "50%",
    "dB": "110dB",
}
"""Example of each unit for messages and help; K is a temperature difference."""

_BY_HAND: Mapping[str, Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "C": {"C": (1, 0), "°C": (1, 0), "K": (1, -273.15), "F": (5 / 9, -160 / 9), "°F": (5 / 9, -160 / 9)},
        "K": {"C": (1, 0), "°C": (1, 0), "K": (1, 0), "F": (5 / 9, 0), "°F": (5 / 9, 0)},
        "%": {"%": (0.01, 0)},
        "dB": {"dB": (1, 0)},
    }
)
"""Factor and offset of the units of temperatures, shares and levels."""

_UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {name: (name, 1.0) for name in ("m", "s", "Hz", "Pa", "V", "N", "count", "rad")}
    | {"g": ("kg", 1e-3), "min": ("s", 60.0), "h": ("s", 3600.0), "bar": ("Pa", 1e5), "deg": ("rad", math.pi / 180)}
)
"""SI unit and factor of the units that may have a prefix."""

_PREFIXES: Mapping[str, float] = MappingProxyType(
    {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9}
)


def _in_si(written: str) -> tuple[str, float]:
    """SI unit and factor of a unit such as mm, kHz or mV/Pa; KeyError if it is unknown."""
    above, slash, below = written.partition("/")
    if slash:
        (unit, factor), (per, divisor) = _in_si(above), _in_si(below)
        return f"{unit}/{per}", factor / divisor
    if written in _UNITS:
        return _UNITS[written]
    unit, factor = _UNITS[written[1:]]
    return unit, _PREFIXES[written[0]] * factor


def parse_quantity(text: str, unit: str) -> float:
    """Value in `unit` of a text such as ``200mm``; ValueError without a suitable unit or number."""
    advice = f"expected a quantity such as {EXAMPLES.get(unit, '1' + unit)}, got {text!r}"
    parts = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-zµ°%]*(?:/[A-Za-zµ]+)?)\s*", text)
    if parts is None:
        raise ValueError(advice)
    written = parts[2] or ("C" if unit == "C" else "")  # A temperature is in degrees Celsius.
    if not written:
        raise ValueError(f"{advice}; add the unit")
    if unit in _BY_HAND:
        if written not in _BY_HAND[unit]:
            raise ValueError(f"{advice}; possible units: {', '.join(_BY_HAND[unit])}")
        factor, offset = _BY_HAND[unit][written]
    else:
        try:
            (measured, factor), offset = _in_si(written), 0.0
        except KeyError:
            raise ValueError(f"{advice}; unknown unit") from None
        if measured != unit:
            raise ValueError(f"{advice}; the unit measures another quantity")
    value = factor * float(parts[1]) + offset
    if not math.isfinite(value):
        raise ValueError(f"{advice}; it must be finite")
    return value


def quantity(unit: str, *, many: int | None = None) -> Parameter:
    """A command-line parameter that reads `many` quantities (None: one, -1: any number), its default in `unit`."""

    def convert(_: Any, tokens: Sequence[Token]) -> float | tuple[float, ...]:
        values = tuple(parse_quantity(token.value, unit) for token in tokens)
        return values if many else values[0]

    def show(value: float | tuple[float, ...] | None) -> str | None:
        if value is None:
            return None
        return " ".join(format_quantity(each, unit) for each in (value if isinstance(value, tuple) else (value,)))

    return Parameter(converter=convert, show_default=show, n_tokens=many or 1, metavar="QUANTITY")


def format_quantity(value: float, unit: str) -> str:
    """A quantity as text: lengths below a metre in millimetres, fractions in %."""
    if unit in _BY_HAND:
        return f"{100 * value:.6g}%" if unit == "%" else f"{value:.6g}{'dB' if unit == 'dB' else 'C'}"
    return f"{value * 1e3:.6g}mm" if unit == "m" and abs(value) < 1 else f"{value:.6g}{unit}"


T = TypeVar("T")
S = TypeVar("S", bound=Declared)
Length = Annotated[float, quantity("m")]
Frequency = Annotated[float, quantity("Hz")]
Time = Annotated[float, quantity("s")]
Force = Annotated[bool, Parameter(alias="-f", help="Overwrite existing files.")]
Json = Annotated[bool, Parameter(alias="-j", help="Print the result as JSON.")]
OptionalTime = Annotated[float | None, quantity("s")]
Source = Annotated[Path, Parameter(help="Recording to read.")]
Output = Annotated[Path, Parameter(help="File to write, in any format that midair can write.")]
Study = Annotated[Path, Parameter(help="Folder of the study.")]
Seed = Annotated[int, Parameter(help="Random seed of the virtual rig.")]
Device = Annotated[str, Parameter(help="virtual, or an array as in midair play.")]
_SOLVED_FOR = "Array on which the drive will be played, as in midair play: its transducers and its stored calibration."
SolvedFor = Annotated[str, Parameter(help=_SOLVED_FOR)]
PART = Group("Part", sort_key=4)
Sensitivity = Annotated[str | None, Parameter(help="Sensitivity of every channel, such as 20mV/Pa or 2count/Pa.")]
_PEAK = "Pressure of the largest change of any channel, such as 30Pa."
Peak = Annotated[float | None, quantity("Pa"), Parameter(help=_PEAK)]
_ARRAY_CALIBRATION = (
    "Measured transducers to solve for, NAME.array.h5 of midair calibrate array; none: the model's. "
    "[default: the calibration stored for a real --device]"
)
ArrayCalibration = Annotated[Path | None, Parameter(help=_ARRAY_CALIBRATION)]
_SPREAD = (
    "Differences between the virtual transducers: default, boards (phases as measured on published boards) or "
    "data-sheets (limits of data sheets)."
)
Spread = Annotated[TransducerSpread, Parameter(help=_SPREAD)]
_REFLECTION = "Reflection factor of the virtual array's face, for the echo of a palm or of a plate around the sensor."
Reflection = Annotated[float, Parameter(help=_REFLECTION)]
_PLACEMENT = "TOML file with position and rotation of the units. [default: two by two, side by side]"
Placement = Annotated[Path | None, Parameter(help=_PLACEMENT)]
_STOP_INPUT = (
    "Hardware stop: any byte or the loss of serial:PORT, evdev:PATH or keyboard silences like midair stop. "
    "If it cannot be opened, nothing plays."
)
StopInput = Annotated[str | None, Parameter(help=_STOP_INPUT)]


def options_from(kind: type[Declared], *names: str, **helps: str) -> Callable[[type[T]], type[T]]:
    """Add to a class an option for each named field of a dataclass of settings, by default for all that can be typed.

    `helps` are help texts for this command, in place of those of the settings.
    """
    hints = get_type_hints(kind)

    def decorate(base: type[T]) -> type[T]:
        made: list[Any] = []
        for one in fields(cast("Any", kind)):
            known = one.metadata
            if not _typed(one) or (names and one.name not in names):
                continue
            said: list[Any] = [Parameter(name=f"--{_typed(one)}", help=helps.get(one.name, known["help"]))]
            if known["unit"]:
                said.append(quantity(known["unit"], many=2 if get_origin(hints[one.name]) is tuple else None))
            plain = Path | None if "load" in known else known.get("typed", hints[one.name])
            default = None if "typed" in known else one.default
            made.append((one.name, Annotated[plain, *said], field(default=default)))
        about = {"__doc__": base.__doc__, "__module__": base.__module__}
        whole: Any = make_dataclass(base.__name__, made, bases=(base,), frozen=True, kw_only=True, namespace=about)
        return Parameter(name="*")(whole)

    return decorate


def settings_from(kind: type[S], options: Any, **more: Any) -> S:
    """The settings that options made by `options_from` describe, and others; None stands for the default."""
    declared = {one.name: one for one in fields(cast("Any", kind))}
    given = {name: getattr(options, name) for name in declared if hasattr(options, name)}
    try:
        return kind().but(**given | more)
    except InputError as wrong:
        if not wrong.setting:
            raise
        raise InputError(f"--{_typed(declared[wrong.setting])}{str(wrong).removeprefix(wrong.setting)}") from None


def _typed(declared: Field[Any]) -> str:
    """Name of the option of a declared setting, "" if it has none."""
    return declared.metadata.get("option", declared.name.replace("_", "-"))


_SOLVER = Group("Solver", sort_key=2)
GROUPS: Mapping[str, Group] = MappingProxyType(
    {"Target": Group("Target", sort_key=1), "Solver": _SOLVER, "Air": Group("Air", sort_key=3), "Part": PART}
)
"""Groups of the options in the help of a command."""


def _option(name: str, otherwise: Mode = "best") -> Parameter:
    """The option of a choice; its help shows the default, and the paper's where it differs."""
    choice = next(each for each in CHOICES if each.name == name)
    shown, paper = (format_value(choice.of(_preset(mode)), choice.unit) for mode in (otherwise, "paper"))
    default = shown if shown == paper else f"{shown}; paper: {paper}"
    how: Any = {"show_default": False if default == "its own" else lambda _: default}  # pyright: ignore[reportUnknownLambdaType]
    said = Parameter(name=f"--{name}", help=choice.help, group=GROUPS[choice.group], **how)
    many = 2 if isinstance(choice.of(_preset("paper")), tuple) else None
    return Parameter.combine(quantity(choice.unit, many=many), said) if choice.unit else said


def _best(_: object) -> str:
    return "best"


@cache
def _preset(mode: Mode) -> Settings:
    return MODES[mode]()


def _setting(name: str, text: str, **more: Any) -> Parameter:
    """An option that selects settings."""
    how: dict[str, Any] = {"show_default": False} | more
    return Parameter(name=name, help=text, group=_SOLVER, **how)


@dataclass(frozen=True, kw_only=True)
class _SettingsOptions:
    """Options on top of a mode or of a settings file; None means not given."""

    otherwise: ClassVar[Mode] = "best"
    """Mode if neither --mode nor --settings is given."""

    def settings(self) -> Settings:
        """The settings that these options select."""
        mode, path = getattr(self, "mode", None), getattr(self, "settings_file", None)
        if mode is not None and path is not None:
            raise InputError(f"expected --mode or --settings, got --mode {mode} and --settings {path}")
        given = self._given()
        height = given.get("height")
        if height is not None and not HEIGHTS[0] <= height <= HEIGHTS[1]:
            low, high = (format_quantity(each, "m") for each in HEIGHTS)
            raise InputError(
                f"--height: expected {low} to {high} of a palm above the array, got {format_quantity(height, 'm')}"
            )
        low, high = given.get("band", (0.0, math.inf))
        if low >= high:
            raise InputError(f"--band: expected the low end first, got {low:g} Hz; give --band {high:g}Hz {low:g}Hz")
        made = MODES[mode or self.otherwise]() if path is None else _settings_of_file(path)
        if lines := getattr(self, "set", ()):
            made = made.with_lines(lines)
        made = made.but(**given)
        if (palm := getattr(self, "palm", None)) is not None:
            for term in made.solver.quiet:
                if isinstance(term, QuietPalm):
                    made = made.but(quiet_palm=QuietPalm.under(files.load_palm(palm), weight=term.weight))
        made.solver.check()
        return made if made.solver.jobs is not None else made.but(jobs=_cores())

    def _given(self) -> dict[str, Any]:
        """The given settings by the keywords of `Settings.but`."""
        names = {choice.name.replace("-", "_") for choice in CHOICES}
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name in names}
        return {name: value for name, value in values.items() if value is not None}


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Part of a recording that is used."""

    start_at: Annotated[Time, Parameter(group=PART)] = 0.0
    """Start of the part to use."""
    duration: Annotated[OptionalTime, Parameter(group=PART)] = None
    """Length of the part to use. [default: to the end]"""
    lead: Annotated[OptionalTime, Parameter(group=PART)] = None
    """Fade time before and after the part. [default: by the mapping]"""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class BandOptions(_SettingsOptions):
    """Which part of a recording counts."""

    otherwise: ClassVar[Mode] = "paper"

    band: Annotated[tuple[float, float] | None, _option("band", "paper")] = None
    rate: Annotated[float | None, _option("rate", "paper")] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PlaySolveOptions(_SettingsOptions):
    """How a recording is solved; without the air of the room, which is an option of playing."""

    rate: Annotated[float | None, _option("rate")] = None
    mapping: Annotated[str | None, _option("mapping")] = None
    gain: Annotated[float | None, _option("gain")] = None
    strength: Annotated[float | None, _option("strength")] = None
    ears: Annotated[float | None, _option("ears")] = None
    height: Annotated[float | None, _option("height")] = None
    circle: Annotated[float | None, _option("circle")] = None
    mode: Annotated[
        Mode | None,
        _setting(
            "--mode",
            "Preset; other options override it. quiet keeps the ears below --ears.",
            alias="-m",
            show_default=_best,
        ),
    ] = None
    settings_file: Annotated[Path | None, _setting("--settings", "Read settings from a TOML file or a drive.")] = None
    set: Annotated[
        tuple[str, ...],
        _setting("--set", "Any other setting, as a line of a settings file: --set target.grid.rows=8. Repeatable."),
    ] = ()
    method: Annotated[str | None, _option("method")] = None
    quiet_ears: Annotated[float | None, _option("quiet-ears")] = None
    palm: Annotated[Path | None, _setting("--palm", "TOML file with a palm's outline. [default: disc of 85 mm]")] = None
    jobs: Annotated[int | None, _option("jobs")] = None
    directivity: Annotated[Directivity | None, _option("directivity")] = None
    band: Annotated[tuple[float, float] | None, _option("band")] = None

    def refuse_idle_palm(self) -> None:
        """Raise InputError for --palm without a quiet palm, where the command would ignore it."""
        if self.palm is not None and not self.settings().solver.quiet_palm:
            raise InputError("--palm: expected --mode finest or a quiet palm in the settings with it, got neither")

    def outline(self) -> Palm:
        """The palm for the evaluation; default: a disc of 85 mm."""
        return Palm.disc() if self.palm is None else files.load_palm(self.palm)

    @property
    def mode_name(self) -> str:
        """Name of the chosen mode in reports."""
        mode = self.mode or self.otherwise
        return "the paper's mode" if mode == "paper" else f"the {mode} mode"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PlayTakeOptions(PlaySolveOptions, PartOptions):
    """How a part of a recording is solved while it plays."""


def given(options: Any) -> str:
    """Names of the options of a dataclass that differ from their defaults."""
    named = [one.name for one in fields(options) if getattr(options, one.name) != one.default]
    return ", ".join(f"--{name.removesuffix('_file').replace('_', '-')}" for name in named)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SolveOptions(PlaySolveOptions):
    """How pressure becomes sound."""

    temperature: Annotated[float | None, _option("temperature")] = None
    humidity: Annotated[float | None, _option("humidity")] = None

    @property
    def air_is_stated(self) -> bool:
        """Whether the user gave the air, by an option or by a settings file."""
        return self.temperature is not None or self.settings_file is not None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class TakeOptions(SolveOptions, PartOptions):
    """How a part of a recording becomes a drive."""

    array_calibration: ArrayCalibration = None


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _settings_of_file(path: Path) -> Settings:
    if not path.name.lower().endswith(".h5"):
        return Settings.load(path)
    found = Settings.of(files.load_solution(path, streamed=True).drive.provenance)
    if found is None:
        raise InputError(f"{path}: expected a drive with stored settings, got one without")
    return found
