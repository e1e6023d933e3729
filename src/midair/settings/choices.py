"""The settings that have an option on the command line, and how settings are written as text."""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

from midair.model import Medium
from midair.settings.settings import MODES, Mode, Settings, flat_names
from midair.solvers import name_of


@dataclass(frozen=True, slots=True)
class Choice:
    """A setting that has an option of its own."""

    name: str
    """Name of the option, such as ``quiet-ears``; with underscores, the keyword of `Settings.but`."""
    path: str
    """Its place in `Settings`, such as ``target.grid.height``."""
    group: Literal["Target", "Solver", "Air", "Part"]
    """Group in the help of commands."""
    help: str
    """Help text: one sentence or noun phrase."""
    unit: str = ""
    """SI unit of a quantity; empty for plain numbers and names."""

    def of(self, settings: Settings) -> Any:
        """Value of this setting; None where what it belongs to is switched off."""
        value: Any = settings
        for part in self.path.split("."):
            # A circle that is off has no attributes, nor has a number that stands for a term.
            value = getattr(value, part, value)
        return value


CHOICES = (
    Choice("band", "calibration.band", "Part", "Frequency band that is kept.", "Hz"),
    Choice("rate", "target.rate", "Target", "Drive frame rate.", "Hz"),
    Choice(
        "mapping",
        "target.mapping",
        "Target",
        "How signed pressure is made positive: half-wave, constant-offset, slow-bias, receptors.",
    ),
    Choice("gain", "target.gain", "Target", "Factor that multiplies the pressure."),
    Choice("strength", "target.strength", "Target", "Target peak relative to that of one focus; replaces --gain."),
    Choice("ears", "target.ears", "Target", "Highest level at the ears.", "dB"),
    Choice("height", "target.grid.height", "Target", "Palm height above the array.", "m"),
    Choice(
        "circle",
        "target.circle.radius",
        "Target",
        "Radius of a slow circle on which the pattern moves, for touch below 20 Hz; not validated on people.",
        "m",
    ),
    Choice("method", "solver.method", "Solver", "Solver: lm (the paper's), fast, glide, free or live."),
    Choice("quiet-ears", "solver.quiet_ears.weight", "Solver", "Penalty on sound at ears; 30: strong."),
    Choice("jobs", "solver.jobs", "Solver", "Blocks that glide solves at once; default: cores."),
    Choice(
        "temperature", "acoustics.medium.temperature", "Air", "Air temperature; none: the paper's 14 C (340 m/s).", "C"
    ),
    Choice("humidity", "acoustics.medium.humidity", "Air", "Relative humidity of the air, 0 to 100 %.", "%"),
    Choice("directivity", "acoustics.directivity", "Air", "Directivity model of a transducer."),
)
"""All settings that have an option; the others are set by ``--set`` and in a file."""

UNITS: Mapping[str, str] = MappingProxyType(
    {choice.path: choice.unit for choice in CHOICES}
    | {
        "target.grid.centre": "m",
        "target.grid.pitch": "m",
        "target.circle.frequency": "Hz",
        "compensation.ramp": "s",
        "compensation.dynamics.time_constant": "s",
        "compensation.dynamics.detuning": "rad/s",
        "solver.guard.margin": "m",
        "solver.guard.pitch": "m",
        "solver.robust": "K",
        "acoustics.medium.density": "kg/m3",
        "acoustics.medium.speed": "m/s",
        "acoustics.medium.attenuation": "Np/m",
    }
)
"""SI unit of each setting that has one, by its place in `Settings`."""


def format_value(value: Any, unit: str = "") -> str:
    """Format a value as a user would type it: lengths in millimetres, yes or no, "none" or "its own" for None.

    The unit K stands for a temperature difference and is typed as C.
    """
    if value is None:
        return "none" if unit else "its own"
    if hasattr(value, "solve"):
        return name_of(value)  # a configured solver is typed by its name
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(format_value(each, unit) for each in value)
    if unit == "m":
        return f"{1e3 * value:.6g}mm"
    if unit in ("C", "K"):
        return f"{value:.6g}C"
    if unit == "%":
        return f"{100 * value:.6g}%"
    return f"{value:.6g}{unit}" if unit or isinstance(value, float) else str(value)


def format_setting(path: str, value: Any) -> str:
    """Format the value of the setting at `path`, such as ``target.grid.height``, with its unit."""
    return format_value(value, UNITS.get(path, "")) if value is not None else "default"


def nearest_mode(settings: Settings) -> tuple[Mode, dict[str, Any]] | None:
    """Return the mode closest to `settings`, and the values that differ from it by their place in `Settings`.

    None where options cannot express the difference, such as a configured solver.
    """
    values = _typed(settings)
    differing: dict[Mode, dict[str, Any]] = {}
    for mode, make in MODES.items():
        others = _typed(make())
        changed = {path: value for path, value in values.items() if others.get(path) != value}
        # What the mode has alone must be replaced by a value in its place, as a method by its name.
        if all(any(path.startswith(f"{each}.") for each in changed) for path in others.keys() - values.keys()):
            differing[mode] = changed
    if not differing:
        return None
    mode = min(differing, key=lambda name: len(differing[name]))
    return mode, differing[mode]


def typed_options(changed: Mapping[str, Any]) -> Iterator[str]:
    """Write the values of `nearest_mode` as options of the command line."""
    import tomli_w

    names = {choice.path: choice for choice in CHOICES}
    for path, value in changed.items():
        if path in names:
            yield f"--{names[path].name} {format_value(value, names[path].unit)}"
        else:
            text = value if isinstance(value, str) else tomli_w.dumps({"x": value}).strip().removeprefix("x = ")
            yield f"--set {shlex.quote(f'{path}={text}')}"


def _typed(settings: Settings) -> dict[str, Any]:
    """Values by their places as a person types them: air that follows from its temperature by the temperature."""
    plain = settings.but(jobs=None, guard=settings.solver.guard or 0.0).plain()
    medium = settings.acoustics.medium
    if medium == Medium(alpha=medium.alpha):
        plain["acoustics"]["medium"] = {"alpha": medium.alpha}
    elif medium.temperature is not None:
        at: dict[str, Any] = {"temperature": medium.temperature, "humidity": medium.humidity, "alpha": medium.alpha}
        if Medium.at(**at) == medium:
            plain["acoustics"]["medium"] = at
    return flat_names(plain)
