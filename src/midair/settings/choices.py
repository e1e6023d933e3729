"""The settings that a user can type: source of the command line's options and of the table in the documentation."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from midair.errors import InputError
from midair.model import Medium
from midair.settings.settings import MODES, Mode, Settings
from midair.solvers import Guard, name_of
from midair.targets import Circle


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """One setting that a user can type."""

    name: str
    """Name of the option, such as ``circle-rate``."""
    path: str
    """Its place in `Settings`, such as ``target.circle.frequency``."""
    help: str
    """Help text: one sentence or noun phrase."""
    unit: str = ""
    """SI unit of a quantity; empty for plain numbers, names and switches."""

    def of(self, settings: Settings) -> Any:
        """Value of this setting; None where the circle or the guard that it belongs to is switched off."""
        value: Any = settings
        for part in self.path.split("."):
            # A circle that is off has no attributes, nor has a number that stands for a term.
            value = getattr(value, part, value)
        return value

    def put(self, settings: Settings, value: Any) -> Settings:
        """Return the settings with this one set to `value`; 0 switches a circle or a term off.

        InputError if the value is out of range, or the circle that it belongs to is off.
        """
        group, name, *inner = self.path.split(".")
        if group == "acoustics":
            chosen = _in_air(settings.acoustics.medium, inner[0], value) if name == "medium" else value
            return settings.but(acoustics=replace(settings.acoustics, **{name: chosen}))
        if not inner:
            # Slowly adapting receptors need the orbit.
            orbit = {"circle": settings.target.circle or Circle()} if value == "receptors" else {}
            return settings.but(**{name: value}, **orbit)
        part = getattr(getattr(settings, group), name)
        if group == "solver":
            if name == "guard":
                part, value = part if isinstance(part, Guard) else Guard(), value or None
            # A term that is on keeps its other settings.
            kept: Any = part if value and is_dataclass(part) else None
            return settings.but(**{name: value if kept is None else replace(kept, **{inner[0]: value})})
        if self.name == "circle":
            if value == 0:
                return settings.but(circle=None)
            part = part or Circle()
        if part is None:
            raise InputError(f"--{self.name}: expected --{name} beside it, got none")
        changes = dict.fromkeys(("rows", "columns") if inner[0] == "rows" else inner, value)
        return settings.but(**{name: replace(part, **changes)})


def _in_air(medium: Medium, name: str, value: float) -> Medium:
    """Return the medium at another temperature or humidity; `alpha` of the surface stays."""
    if name == "humidity" and medium.temperature is None:
        raise InputError("--humidity: expected --temperature beside it, got none")
    known = {"temperature": medium.temperature, "humidity": medium.humidity} | {name: value}
    return Medium.at(alpha=medium.alpha, **{key: each for key, each in known.items() if each is not None})


CHOICES: tuple[Choice, ...] = tuple(
    Choice(name=name, **entry)
    for name, entry in tomllib.loads(Path(__file__).with_name("choices.toml").read_text(encoding="utf-8")).items()
)
"""All settings that have an option, in the order of processing."""


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


def nearest_mode(settings: Settings) -> tuple[Mode, dict[str, Any]] | None:
    """Return the mode closest to `settings` and the choices that differ from it, by name.

    None where choices cannot express the difference, such as the envelope of a measured array.
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
        name: name_of(value) if name == "method" else 0.0 if value is None and name in ("circle", "guard") else value
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
"""SI unit of each setting that has one, by its place in `Settings`."""


def format_setting(path: str, value: Any) -> str:
    """Format the value of the setting at `path`, such as ``target.grid.height``, with its unit."""
    return format_value(value, UNITS.get(path, "")) if value is not None else "default"
