"""Each setting as a person types it: options of commands and the table of the documentation come from here."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from midair.errors import InputError
from midair.model import Medium
from midair.settings.mode import MODES, Mode
from midair.settings.settings import Settings
from midair.solvers import Guard, QuietPalm, name_of
from midair.targets import Circle


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """One setting as a person types it.

    Attributes
    ----------
    name : str
        Of the option, such as ``circle-rate``.
    path : str
        Where it is in `Settings`, such as ``target.circle.frequency``.
    help : str
        One sentence.
    unit : str
        Of a quantity; empty for numbers without one, names and switches.
    """

    name: str
    path: str
    help: str
    unit: str = ""

    def of(self, settings: Settings) -> Any:
        """Its value; None where what it belongs to is off."""
        value: Any = settings
        for part in self.path.split("."):
            # What is off has no parts, and a guard that is given by its width alone is its own margin.
            value = getattr(value, part, value)
        # Of a palm with an outline people type the weight.
        return value.weight if isinstance(value, QuietPalm) else value

    def put(self, settings: Settings, value: Any) -> Settings:
        """The settings with it.

        A radius or a margin of 0 switches a circle or a guard off, any other switches it on.

        Raises
        ------
        InputError
            If the value is out of range, or it belongs to something that is off.
        """
        group, name, *inner = self.path.split(".")
        if group == "acoustics":
            chosen = _in_air(settings.acoustics.medium, inner[0], value) if name == "medium" else value
            return settings.but(acoustics=replace(settings.acoustics, **{name: chosen}))
        if name == "quiet_palm" and value > 0 and isinstance(settings.solver.quiet_palm, QuietPalm):
            value = replace(settings.solver.quiet_palm, weight=value)
        if not inner:
            return settings.but(**{name: value})
        part = getattr(getattr(settings, group), name)
        if name in _SWITCHED and inner[0] == _SWITCHED[name][0]:
            if value == 0:
                return settings.but(**{name: None})
            part = part if isinstance(part, Guard | Circle) else _SWITCHED[name][1]()
        if part is None:
            raise InputError(f"--{self.name}: expected --{name} beside it, got none")
        changes = dict.fromkeys(("rows", "columns") if inner[0] == "rows" else inner, value)
        return settings.but(**{name: replace(part, **changes)})


def _in_air(medium: Medium, name: str, value: float) -> Medium:
    """The medium at another temperature or humidity; the surface in it stays."""
    if name == "humidity" and medium.temperature is None:
        raise InputError("--humidity: expected --temperature beside it, got none")
    known = {"temperature": medium.temperature, "humidity": medium.humidity} | {name: value}
    return Medium.at(alpha=medium.alpha, **{key: each for key, each in known.items() if each is not None})


_SWITCHED: Mapping[str, tuple[str, type[Guard] | type[Circle]]] = MappingProxyType(
    {"guard": ("margin", Guard), "circle": ("radius", Circle)}
)
"""Terms that are there when their first length is above 0."""

CHOICES: tuple[Choice, ...] = (
    Choice(name="band", path="calibration.band", unit="Hz", help="Lowest and highest frequency that is kept."),
    Choice(name="inverse", path="calibration.inverse", help="Undo the sensor by zero-phase FFT or linear-phase FIR."),
    Choice(name="rate", path="target.rate", unit="Hz", help="Frames per second of what is played."),
    Choice(
        name="mapping",
        path="target.mapping",
        help="From pressure of both signs to pressure that pushes: half-wave, constant-offset or slow-bias.",
    ),
    Choice(name="interpolate", path="target.interpolate", help="What is interpolated between the cells."),
    Choice(name="gain", path="target.gain", help="Multiplies the pressure."),
    Choice(
        name="strength",
        path="target.strength",
        help="In place of a gain: peak over one focus.",
    ),
    Choice(name="height", path="target.grid.height", unit="m", help="Of the palm above the array."),
    Choice(name="pitch", path="target.grid.pitch", unit="m", help="Between the control points."),
    Choice(name="points", path="target.grid.rows", help="Rows and columns of the control points."),
    Choice(
        name="circle",
        path="target.circle.radius",
        unit="m",
        help="Radius of a slow circle on which the pattern moves, for touch below 20 Hz; not validated on people.",
    ),
    Choice(name="circle-rate", path="target.circle.frequency", unit="Hz", help="Turns per second on that circle."),
    Choice(
        name="decouple",
        path="compensation.decouple",
        help="Undo that a cell also feels what is played for its neighbours.",
    ),
    Choice(
        name="precompensate",
        path="compensation.precompensate",
        help="Make louder beforehand what holding frames and transducers make quieter.",
    ),
    Choice(
        name="compensate",
        path="compensation.compensate",
        help="On the sound, or on the pressure within 20 to 480 Hz.",
    ),
    Choice(name="method", path="solver.method", help="The solver; lm is the paper's, exact its cheaper form."),
    Choice(
        name="iterations",
        path="solver.iterations",
        help="At most, for the first frame and for each later one; 50 and 20 in the paper.",
    ),
    Choice(name="start", path="solver.start", help="Where a frame starts."),
    Choice(
        name="level", path="solver.level", help="Drive of all transducers, 0 to 1; auto: what the loudest frame needs."
    ),
    Choice(
        name="amplitudes",
        path="solver.amplitudes",
        help="All transducers at that level, or each at its own up to it.",
    ),
    Choice(
        name="guard",
        path="solver.guard.margin",
        unit="m",
        help="Width of a ring around the control points in which the field is kept quiet; 0mm for none.",
    ),
    Choice(
        name="fit",
        path="solver.fit",
        help="What is met: points; windows, wherever a palm lies; or cells, for one place of a sensor alone.",
    ),
    Choice(name="smooth", path="solver.smooth", help="Weight of phases that change; 0.01 is much."),
    Choice(
        name="robust",
        path="solver.robust",
        unit="K",
        help="Phases that hold in air as much colder and warmer than --temperature.",
    ),
    Choice(
        name="quiet-ears",
        path="solver.quiet_ears",
        help="Weight of the sound at the ears of a person in front of the array: 3 is some, 30 much.",
    ),
    Choice(
        name="quiet-palm",
        path="solver.quiet_palm",
        help="Weight of the sound on a palm, 100 mm or --palm, around the points: 0.1 is much.",
    ),
    Choice(
        name="backend",
        path="solver.backend",
        help="Of fast and glide: numpy, torch, torch:cuda or cupy.",
    ),
    Choice(name="jobs", path="solver.jobs", help="Blocks of glide at once; all cores if not given."),
    Choice(
        name="temperature",
        path="acoustics.medium.temperature",
        unit="C",
        help="Of the air; none: the paper's 340 m/s, 14C.",
    ),
    Choice(name="humidity", path="acoustics.medium.humidity", unit="%", help="Of the air, relative."),
    Choice(name="directivity", path="acoustics.directivity", help="Of a transducer."),
)
"""What can be chosen by name, in the order of the way."""


def spelt(value: Any, unit: str = "") -> str:
    """A value as a person would type it: lengths in millimetres, yes and no, nothing for a solver's own choice.

    The unit K is that of a difference of temperatures, typed as C.
    """
    if value is None:
        return "none" if unit else "its own"
    if hasattr(value, "solve"):
        return name_of(value)  # a configured solver, of which a person types the name
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(spelt(each, unit) for each in value)
    if unit == "m":
        return f"{1e3 * value:.6g}mm"
    if unit in ("C", "K"):
        return f"{value:.6g}C"
    if unit == "%":
        return f"{100 * value:.6g}%"
    return f"{value:.6g}{unit}" if unit or isinstance(value, float) else str(value)


def over_mode(settings: Settings) -> tuple[Mode, dict[str, Any]] | None:
    """The mode that is nearest to settings, and the choices that differ from it, by name; None if these do not suffice.

    They do not where a setting differs that is no choice, such as the envelope of an array that was measured.
    """
    differing: dict[Mode, dict[str, Any]] = {
        mode: {
            choice.name: choice.of(settings)
            for choice in CHOICES
            if choice.name != "jobs" and choice.of(settings) != choice.of(make())
        }
        for mode, make in MODES.items()
    }
    mode = min(differing, key=lambda name: len(differing[name]))
    chosen = {
        name: name_of(value) if name == "method" else 0.0 if value is None and name in _SWITCHED else value
        for name, value in differing[mode].items()
    }
    made = MODES[mode]()
    try:
        for choice in CHOICES:
            if choice.name in chosen:
                made = choice.put(made, chosen[choice.name])
    except (InputError, TypeError):
        return None
    return (mode, chosen) if made == settings else None


UNITS: Mapping[str, str] = MappingProxyType(
    {choice.path: choice.unit for choice in CHOICES}
    | {
        "target.grid.centre": "m",
        "compensation.ramp": "s",
        "compensation.dynamics.time_constant": "s",
        "compensation.dynamics.detuning": "rad/s",
        "solver.guard.pitch": "m",
        "acoustics.medium.density": "kg/m3",
        "acoustics.medium.speed": "m/s",
        "acoustics.medium.attenuation": "Np/m",
    }
)
"""Units of settings by their place in `Settings`; the others have none."""


def spelt_setting(path: str, value: Any) -> str:
    """A setting's value as a person would type it, with its unit, by its place such as ``target.grid.height``."""
    return spelt(value, UNITS.get(path, "")) if value is not None else "default"


def choices_table() -> str:
    """The table of the documentation: every choice, its place in `Settings`, what it is, its value in each mode.

    The best mode's value is left out where it is the paper's, the others' where it is the best one's.
    """
    lines = ["| option, in `Settings` | what | paper | best | quick | finest |", "| --- " * 6 + "|"]
    for choice in CHOICES:
        paper, best, *others = (spelt(choice.of(MODES[mode]()), choice.unit) for mode in MODES)
        said = " | ".join([paper, best if best != paper else "", *(each if each != best else "" for each in others)])
        lines.append(f"| `--{choice.name}`<br>`{choice.path}` | {choice.help} | {said} |")
    return "\n".join(lines)
