"""Options that several commands share; those of the settings are generated from `settings.CHOICES`.

A quantity is a number with a unit, such as 200mm, 20Hz or .5s.
"""

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, field, fields, make_dataclass
from functools import cache, reduce
from operator import or_
from pathlib import Path
from types import MappingProxyType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from cyclopts import Parameter, Token

from midair import files
from midair.errors import InputError
from midair.model import HEIGHTS, Palm
from midair.settings import CHOICES, MODES, Choice, Mode, Settings, TransducerSpread, format_value
from midair.solvers import QuietPalm
from midair.validation import Declared

EXAMPLES = {
    "m": "200mm",
    "Hz": "20Hz",
    "s": "0.5s",
    "Pa": "30Pa",
    "count/Pa": "2count/Pa",
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
        value = factor * float(parts[1]) + offset
        if not math.isfinite(value):
            raise ValueError(f"{advice}; it must be finite")
        return value
    try:
        measured, factor = _in_si(written)
    except KeyError:
        raise ValueError(f"{advice}; unknown unit") from None
    if measured != unit:
        raise ValueError(f"{advice}; the unit measures another quantity")
    value = float(parts[1]) * factor
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
Quiet = Annotated[bool, Parameter(help="Hide progress bars and meters, as -q does.")]
OptionalTime = Annotated[float | None, quantity("s")]
Source = Annotated[Path, Parameter(help="Recording to read.")]
Output = Annotated[Path, Parameter(help="File to write, in any format that midair can write.")]
Study = Annotated[Path, Parameter(help="Folder of the study.")]
Seed = Annotated[int, Parameter(help="Random seed of the virtual rig.")]
StartAt = Annotated[Time, Parameter(help="Start of the part to use.")]
PartLength = Annotated[OptionalTime, Parameter(help="Length of the part to use. [default: to the end]")]
Lead = Annotated[OptionalTime, Parameter(help="Fade time before and after the part. [default: by the mapping]")]
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


class _SettingsOptions:
    """Options on top of a mode or of a settings file; None means not given."""

    otherwise: ClassVar[Mode] = "paper"
    """Mode if neither --mode nor --settings is given."""

    def settings(self) -> Settings:
        """The settings that these options select."""
        mode, path = getattr(self, "mode", None), getattr(self, "settings_file", None)
        if mode is not None and path is not None:
            raise InputError(f"expected --mode or --settings, got --mode {mode} and --settings {path}")
        height = getattr(self, "height", None)
        if height is not None and not HEIGHTS[0] <= height <= HEIGHTS[1]:
            low, high = (format_quantity(each, "m") for each in HEIGHTS)
            raise InputError(
                f"--height: expected {low} to {high} of a palm above the array, got {format_quantity(height, 'm')}"
            )
        made = MODES[mode or self.otherwise]() if path is None else _settings_of_file(path)
        for choice in CHOICES:
            value = getattr(self, choice.name.replace("-", "_"), None)
            if value is not None:
                made = choice.put(made, value)
        if (palm := getattr(self, "palm", None)) is not None:
            for term in made.solver.quiet:
                if isinstance(term, QuietPalm):
                    made = made.but(quiet_palm=QuietPalm.under(files.load_palm(palm), weight=term.weight))
        made.solver.check()
        if made.solver.jobs is None:
            made = made.but(jobs=_cores())
        return made

    def refuse_idle_palm(self) -> None:
        """Raise InputError for --palm without a quiet palm, where the command would ignore it."""
        if getattr(self, "palm", None) is not None and not self.settings().solver.quiet_palm:
            raise InputError("--palm: expected --quiet-palm or --mode finest with it, got neither")

    def outline(self) -> Palm:
        """The palm for the evaluation; default: a disc of 85 mm."""
        palm = getattr(self, "palm", None)
        return Palm.disc() if palm is None else files.load_palm(palm)

    def typed(self) -> list[str]:
        """Command-line arguments that select the same settings."""
        words: list[str] = []
        mode, path = getattr(self, "mode", None), getattr(self, "settings_file", None)
        words += [] if mode is None else ["--mode", mode]
        palm = getattr(self, "palm", None)
        words += [] if path is None else ["--settings", str(path)]
        words += [] if palm is None else ["--palm", str(palm)]
        for choice in CHOICES:
            value = getattr(self, choice.name.replace("-", "_"), None)
            if isinstance(value, bool):
                words.append(f"--{choice.name}" if value else f"--no-{choice.name}")
            elif value is not None:
                many = value if isinstance(value, tuple) else (value,)
                words += [f"--{choice.name}", *(_argument(each, choice.unit) for each in many)]
        return words

    @property
    def air_is_stated(self) -> bool:
        """Whether the user gave the air, by an option or by a settings file."""
        return getattr(self, "temperature", None) is not None or getattr(self, "settings_file", None) is not None


def _argument(value: Any, unit: str) -> str:
    if not unit:
        return str(value)
    return f"{100 * value!r}%" if unit == "%" else f"{value!r}{unit}"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _settings_of_file(path: Path) -> Settings:
    if not path.name.lower().endswith(".h5"):
        return Settings.load(path)
    found = Settings.of(files.load_solution(path, streamed=True).drive.provenance)
    if found is None:
        raise InputError(f"{path}: expected a drive with stored settings, got one without (written by an older midair)")
    return found


# Each is needed for every choice.
_PRESETS = {"paper": MODES["paper"](), "best": MODES["best"]()}
_hints = cache(get_type_hints)


def _parameter(choice: Choice, otherwise: Literal["paper", "best"]) -> Any:
    """The option of a choice; its help shows the default, and the paper's where the best mode's differs."""
    # No objects, and the tuple where both a number and a tuple are allowed.
    hint: Any = Settings
    for part in choice.path.split("."):
        holder = next(each for each in _alternatives(hint) if hasattr(each, "__dataclass_fields__"))
        hint = _hints(holder)[part]
    plain = [
        each for each in _alternatives(hint) if not hasattr(each, "__dataclass_fields__") and each is not type(None)
    ]
    pairs = [each for each in plain if get_origin(each) is tuple]
    kind = pairs[0] if pairs else reduce(or_, plain)

    shown = {name: format_value(choice.of(preset), choice.unit) for name, preset in _PRESETS.items()}
    default = shown[otherwise]
    if otherwise == "best" and shown["best"] != shown["paper"]:
        default += f"; paper: {shown['paper']}"

    negative = f"--no-{choice.name}" if kind is bool else ()
    said = Parameter(
        name=f"--{choice.name}", help=choice.help, show_default=_constant_default(default), negative=negative
    )
    if not choice.unit:
        return Annotated[kind | None, said]
    pair = get_origin(kind) is tuple
    return Annotated[kind | None, quantity(choice.unit, many=2 if pair else None), said]


def _constant_default(default: str) -> Any:
    """Formatter that always shows this default; False where the solver has its own."""

    def shown(_: object) -> str:
        return default

    return False if default == "its own" else shown


def _alternatives(hint: Any) -> Sequence[Any]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def _options(name: str, doc: str, names: Sequence[str] | None = None, *, modes: bool = False) -> Any:
    """A dataclass of options, all None unless given."""
    chosen = [choice for choice in CHOICES if names is None or choice.name in names]
    first: list[Any] = []
    if modes:
        mode = Parameter(
            name=("--mode", "-m"),
            help="Preset that other options override; quiet: under --ears.",
            show_default=_constant_default("best"),
        )
        path = Parameter(name="--settings", help="Read settings from a TOML file or a drive.", show_default=False)
        outline = "TOML file with a palm's outline. [default: disc of 85 mm]"
        palm = Parameter(name="--palm", help=outline, show_default=False)
        first = [
            ("mode", Annotated[Mode | None, mode], field(default=None)),
            ("settings_file", Annotated[Path | None, path], field(default=None)),
            ("palm", Annotated[Path | None, palm], field(default=None)),
        ]
    otherwise: Literal["paper", "best"] = "best" if modes else "paper"
    rest = [(choice.name.replace("-", "_"), _parameter(choice, otherwise), field(default=None)) for choice in chosen]
    space = {"__doc__": doc, "__module__": __name__, "otherwise": otherwise}
    made = make_dataclass(name, [*first, *rest], bases=(_SettingsOptions,), frozen=True, kw_only=True, namespace=space)
    return Parameter(name="*")(made)


if TYPE_CHECKING:

    class BandOptions(_SettingsOptions):
        """Which part of a recording counts."""

    class SolveOptions(_SettingsOptions):
        """How pressure becomes sound."""

    class PlaySolveOptions(_SettingsOptions):
        """How a recording is solved while it plays."""

else:
    BandOptions = _options("BandOptions", "Which part of a recording counts.", ("band", "rate", "inverse"))
    SolveOptions = _options("SolveOptions", "How pressure becomes sound.", modes=True)
    # The room's air is an option of playing.
    _solved = [choice.name for choice in CHOICES if choice.name not in ("temperature", "humidity")]
    PlaySolveOptions = _options("PlaySolveOptions", "How a recording is solved while it plays.", _solved, modes=True)


_SHARED = ("band", "height", "pitch", "points", "temperature", "humidity", "directivity")
"""Settings of the recording and the room, which a comparison of two modes shares."""


def paper_options(options: SolveOptions) -> SolveOptions | None:
    """Options of the paper's mode with the same recording and room; None if the paper's mode was chosen.

    The solver is glide: the paper's own takes seven times as long for the same signal-to-distortion ratio on the
    sensor.
    """
    if getattr(options, "mode", None) == "paper":
        return None
    settings, paper = options.settings(), MODES["paper"]()
    shared = [choice for choice in CHOICES if choice.name in _SHARED]
    values = {choice.name: choice.of(settings) for choice in shared if choice.of(settings) != choice.of(paper)}
    given = {name: value for name, value in values.items() if value is not None}
    made: Any = SolveOptions
    return made(mode="paper", method="glide", **given)


def mode_name(options: SolveOptions) -> str:
    """Name of the chosen mode in reports."""
    mode = getattr(options, "mode", None) or options.otherwise
    return "the paper's mode" if mode == "paper" else f"the {mode} mode"
