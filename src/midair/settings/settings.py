"""All settings of the pipeline from a recording to a drive as one value, and its modes."""

import os
import tomllib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any, Literal

from midair.errors import BrokenFileError, InputError
from midair.files import from_plain, read_toml, to_plain, write_file
from midair.model import BAND, RATE, Acoustics, ArrayCalibration, ControlGrid, Medium, Provenance, Setting
from midair.physics import TransducerDynamics
from midair.solvers import Free, Glide, Guard, QuietEars, SolverSettings, name_of
from midair.solvers import solver as solver_of
from midair.targets import Circle, Interpolated
from midair.validation import check_calls, check_names, number, within


@check_calls
@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """Settings of the calibration, from samples to pressure."""

    band: tuple[float, float] = BAND
    """(low, high) of the frequency band that is kept, in Hz (paper, 3)."""


EARS = (80.0, 160.0)
"""Smallest and largest level at the ears that can be asked for, in dB."""

MOST_GAIN = 1000.0
"""Highest gain of a target."""

STRONGEST = 10.0
"""Largest allowed strength: ten times the maximum of any array."""


@check_calls
@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSettings:
    """Settings of the target, from pressure to sound amplitude."""

    rate: float = RATE
    """Frame rate of the drive in Hz: the ultrasound's 40 kHz divided by an integer (paper, 3)."""
    mapping: str = "half-wave"
    """How signed pressure is made positive (4.1); "slow-bias" distorts least."""
    interpolate: Interpolated = "amplitude"
    """Quantity that is interpolated between the cells (4.1)."""
    gain: float = 1.0
    """Factor that multiplies the pressure (5.2)."""
    strength: float | None = None
    """Peak of the target's sound relative to one focus of the whole array at full drive; replaces the gain unless None.
    """
    ears: float | None = None
    """Highest sound level in dB at ears and bystander by the exposure check, at 14 to 30 °C. The gain is reduced until
    the drive meets it, also if the transducers differ as those of published boards do; None for no limit.
    """
    grid: ControlGrid = field(default_factory=ControlGrid)
    """Control points (4.1)."""
    height_uncertainty: float = 3e-3
    """Standard uncertainty of the palm's height in m. It says how much of the echo between palm and array is corrected,
    where the reflection was measured: a half at .8 mm, nothing above 2 mm."""
    circle: Circle | None = None
    """Slow circle on which the pattern moves, for touch below 20 Hz; not in the paper, not validated on people."""

    def __post_init__(self) -> None:
        within(self.gain, "gain", 0, MOST_GAIN, above=True)
        number(self.rate, "rate", "Hz")
        within(self.height_uncertainty, "height uncertainty", 0, 0.1, unit="m")
        if self.ears is not None:
            within(self.ears, "ears", *EARS, unit="dB", advice="typical value: 110")
        if self.strength is not None:
            advice = "it is relative to one focus of the whole array; typical value: 0.15"
            within(self.strength, "strength", 0, STRONGEST, above=True, advice=advice)


@check_calls
@dataclass(frozen=True, slots=True, kw_only=True)
class CompensationSettings:
    """Compensation in advance of losses in later stages; the paper has none."""

    decouple: bool = False
    """Whether to correct for the pressure that a cell receives from neighbouring cells."""
    precompensate: bool = False
    """Whether to compensate the attenuation by frame hold and transducer envelope."""
    compensate: Literal["sound", "pressure"] = "sound"
    """Compensated quantity: sound amplitude at all frequencies, or pressure within 20-480 Hz."""
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    """Transducer envelope that is compensated."""
    ramp: float = 0.0
    """Ramp of the silencer that is compensated, in s."""
    predict: bool = False
    """Whether to correct the phases by a prediction of each transducer's envelope; always for a measured array."""


@check_calls
@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All settings, in the order of processing; the defaults are the paper's.

    Its solver is the paper's in a faster form; ``method=midair.solvers.PLAIN`` is the form as printed.
    """

    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
    target: TargetSettings = field(default_factory=TargetSettings)
    compensation: CompensationSettings = field(default_factory=CompensationSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    acoustics: Acoustics = field(default_factory=Acoustics)
    """Air (2.1) and directivity of a transducer (2.2)."""

    def but(self, **changes: Any) -> "Settings":
        """Return the settings with other values, named as in their groups: ``but(rate=4000.0, gain=2.0)``.

        Named without a group are also the height of the grid, the directivity, and the temperature and humidity of the
        air. A number stands for the radius of the circle, the margin of the guard or the weight of quiet ears or a
        quiet palm, of which the rest stays; 0 switches them off. The mapping "receptors" brings the circle that it
        needs.

        InputError if there is no setting of that name, or a value is out of range.
        """
        if air := {name: changes.pop(name) for name in ("temperature", "humidity") if name in changes}:
            changes["medium"] = _in_air(self.acoustics.medium, air)
        if parts := {name: changes.pop(name) for name in ("medium", "directivity") if name in changes}:
            changes["acoustics"] = replace(changes.get("acoustics", self.acoustics), **parts)
        if "acoustics" in changes:
            return replace(self, acoustics=changes.pop("acoustics")).but(**changes)
        if "height" in changes:
            changes["grid"] = replace(changes.get("grid", self.target.grid), height=changes.pop("height"))
        if changes.get("mapping") == "receptors":
            changes.setdefault("circle", self.target.circle or Circle())
        if isinstance(radius := changes.get("circle"), int | float):
            changes["circle"] = replace(self.target.circle or Circle(), radius=radius) if radius else None
        for term, main in (("guard", "margin"), ("quiet_ears", "weight"), ("quiet_palm", "weight")):
            value, before = changes.get(term), getattr(self.solver, term)
            if isinstance(value, int | float) and value and is_dataclass(before) and not isinstance(before, type):
                changes[term] = replace(before, **{main: value})
        check_names(changes, [*_GROUPS, "acoustics", "height", "directivity", "temperature", "humidity"])
        groups: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            groups.setdefault(_GROUPS[name], {})[name] = value
        return replace(self, **{group: replace(getattr(self, group), **some) for group, some in groups.items()})

    def with_lines(self, lines: Iterable[str]) -> "Settings":
        """Return the settings with other values, each a line of a settings file such as ``target.grid.rows=8``.

        Text needs no quotes: ``solver.level=auto``. InputError if a name or a value is not valid.
        """
        plain = self.plain()
        for values in map(_parsed, lines):
            acoustics: Any = values.get("acoustics", {})
            air: Any = acoustics.get("medium", {}) if isinstance(acoustics, Mapping) else {}
            told = ("temperature", "humidity", "alpha")
            if isinstance(air, Mapping) and air and set(air) <= set(told):
                medium = plain["acoustics"]["medium"]
                # The rest of the air follows from these.
                plain["acoustics"]["medium"] = {name: medium[name] for name in told if name in medium}
            _merge(plain, values)
        return Settings.from_plain(plain)

    def measured(self, calibration: ArrayCalibration) -> "Settings":
        """Return the settings with the mean transducer envelope of a measured array."""
        pole = calibration.pole[~calibration.dead].mean()
        return self.but(dynamics=TransducerDynamics(time_constant=float(-1 / pole.real), detuning=float(pole.imag)))

    def plain(self) -> dict[str, Any]:
        """Return nested dicts of numbers and strings, without None values; inverse of `from_plain`.

        InputError if `fit` is a configured object, which has no text form.
        """
        # A configured fit holds arrays: its drive cannot be reproduced from text.
        if not isinstance(self.solver.fit, str):
            raise InputError(
                'fit: expected "points", "windows", "fine-windows" or "cells" (the forms that can be saved), got a '
                "configured object"
            )
        made: dict[str, Any] = to_plain(self)
        if not isinstance(self.solver.method, str):
            made["solver"]["method"] = {"name": name_of(self.solver.method)} | made["solver"]["method"]
        return made

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> "Settings":
        """Build settings from the dicts of `plain`; missing values are the paper's.

        A medium that has only temperature, humidity and alpha becomes `Medium.at` of them. InputError if a name or a
        value is not valid.
        """
        values = _with_air(values)
        solver: Any = values.get("solver", {})
        method: Any = solver.get("method") if isinstance(solver, Mapping) else None
        if not isinstance(method, Mapping):
            return from_plain(cls, values)
        given = {str(name): value for name, value in method.items() if name != "name"}
        kind = type(solver_of(str(method.get("name"))))
        rest = {name: value for name, value in solver.items() if name != "method"}
        made: Settings = from_plain(cls, {**values, "solver": rest})
        return made.but(method=from_plain(kind, given, where="solver.method."))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the settings as TOML; FileError if the file cannot be written."""
        import tomli_w

        write_file(path, tomli_w.dumps(self.plain()))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Settings":
        """Read settings from a TOML file; MissingFileError or BrokenFileError if there are none."""
        plain = read_toml(path, "settings in TOML")
        try:
            return cls.from_plain(plain)
        except InputError as wrong:
            raise BrokenFileError(f"{path}: expected settings in TOML, got: {wrong}") from wrong

    def noted(self, provenance: Provenance) -> Provenance:
        """Return the provenance with all settings as a step; unchanged if `fit` has no text form."""
        if not isinstance(self.solver.fit, str):
            return provenance
        # The number of jobs does not affect the result.
        return provenance.then("settings", flat_names(self.but(jobs=None).plain()))

    @classmethod
    def of(cls, provenance: Provenance) -> "Settings | None":
        """Return the settings stored in a provenance; None if it has none."""
        told = provenance.last("settings")
        return cls.from_plain(_nested(told)) if told else None


_GROUPS: Mapping[str, str] = MappingProxyType(
    {
        choice.name: group
        for group, kind in (
            ("calibration", CalibrationSettings),
            ("target", TargetSettings),
            ("compensation", CompensationSettings),
            ("solver", SolverSettings),
        )
        for choice in fields(kind)
    }
)
"""Group of each setting."""


def _with_air(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Complete a medium that is given by its temperature: otherwise the speed of sound would be that at 14 C.

    Values of a wrong type stay, so that `from_plain` reports them.
    """
    acoustics: Any = values.get("acoustics")
    medium: Any = acoustics.get("medium") if isinstance(acoustics, Mapping) else None
    told = {"temperature", "humidity", "alpha"}
    if not isinstance(medium, Mapping) or "temperature" not in medium or not set(medium) <= told:
        return values
    if not all(isinstance(each, int | float) for each in medium.values()):
        return values
    return {**values, "acoustics": {**acoustics, "medium": to_plain(Medium.at(**medium))}}


def _in_air(medium: Medium, air: Mapping[str, float | None]) -> Medium:
    """Return the medium at another temperature or humidity; `alpha` of the surface stays."""
    known: dict[str, float | None] = {"temperature": medium.temperature, "humidity": medium.humidity, **air}
    if known["temperature"] is None:
        raise InputError("--humidity: expected --temperature beside it, got none")
    return Medium.at(alpha=medium.alpha, **{name: each for name, each in known.items() if each is not None})


def _parsed(line: str) -> dict[str, Any]:
    name, equals, value = line.partition("=")
    for text in (line, f"{name}='{value}'"):
        with suppress(tomllib.TOMLDecodeError):
            if equals:
                return tomllib.loads(text)
    raise InputError(f"expected NAME=VALUE as in a settings file, such as target.grid.rows=8, got {line!r}")


def _merge(plain: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Put values into nested dicts of settings; a table replaces a plain value, and the reverse."""
    for name, value in values.items():
        if isinstance(value, dict) and isinstance(plain.get(name), dict):
            _merge(plain[name], value)  # pyright: ignore[reportUnknownArgumentType]
        else:
            plain[name] = value


def flat_names(values: Mapping[str, Any], before: str = "") -> dict[str, Setting]:
    """Join nested names by dots, the form of provenance."""
    flat: dict[str, Setting] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flat_names(value, f"{before}{name}.")  # pyright: ignore[reportUnknownArgumentType]
        else:
            flat[f"{before}{name}"] = tuple(value) if isinstance(value, list) else value
    return flat


def _nested(flat: Mapping[str, Setting]) -> dict[str, Any]:
    """Split the names that `flat_names` joined."""
    nested: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, last = name.split(".")
        inner = nested
        for group in groups:
            inner = inner.setdefault(group, {})
        inner[last] = value
    return nested


TransducerSpread = Literal["default", "boards", "data-sheets"]
"""Names of the differences between virtual transducers: of midair, of published boards, limits of data sheets."""

Mode = Literal["paper", "best", "quick", "finest", "quiet"]
"""Names: the paper's settings; the default; it at a third of its rate; with a quiet palm; under a level at the ears."""


def paper_mode() -> Settings:
    """Return the settings of the paper: half-wave rectification, 1 kHz, control points alone (4.1, 4.2, 5.2)."""
    return Settings()


# At 1.3 to 4 kHz frames are so alike that few marks and iterations suffice; the phases change less. None is rough.
_GLIDE = Glide(
    coarse=512,
    cold=(80, 10, 80),
    near=0.2,
    far=1.0,
    smooth=7,
    smooth_last=7,
    bent_wide=(12, 9, 40),
    wide=32,
    smooth_wide=20,
    tolerance=1e-2,
)


def best_mode() -> Settings:
    """Return the default settings: slow bias, 4 kHz, guard ring, all frames solved together (method glide).

    The target is corrected for the mixing of neighbouring cells and for the attenuation by frame hold and transducers.
    The air is a laboratory's, 22 degrees Celsius and 50 % humidity, instead of the paper's 14 degrees.
    """
    return Settings().but(
        # At 4 kHz a frame between two solved ones is so alike that four iterations suffice.
        method=replace(_GLIDE, smooth_last=4),
        fit="windows",
        mapping="slow-bias",
        rate=4000.0,
        precompensate=True,
        interpolate="pressure",
        decouple=True,
        # A touch that needs less than the whole array's power keeps over more heights.
        convergence="auto",
        guard=Guard(margin=25e-3, pitch=5.5e-3, ceiling=0.3),
        acoustics=Acoustics(medium=Medium.at()),
    )


def quick_mode() -> Settings:
    """Return the best mode at a third of its frame rate, 40 kHz / 30."""
    # Frames are less alike, so those of the last level need as many iterations as others.
    return best_mode().but(rate=40e3 / 30, method=_GLIDE)


def finest_mode() -> Settings:
    """Return the best mode for a whole palm, in about four times the time.

    The palm around the square is quiet; windows of half a cell leave no pressure between the cells uncontrolled; the
    level and the amplitudes follow the target; and the envelopes of the transducers are predicted. The guard stays,
    since a mean square over the palm hardly penalises a single spot beside the square.
    """
    return best_mode().but(
        method=_GLIDE,
        quiet_palm=0.1,
        fit="fine-windows",
        convergence=1.0,
        level="auto",
        amplitudes="bounded",
        predict=True,
    )


def quiet_mode() -> Settings:
    """Return the best mode with free amplitudes, as strong as 110 dB at ears and bystander permit, or another level.

    The ears are quiet in rooms of 14 to 30 °C, so that a play passes the exposure check without a stated temperature.
    """
    everyone = (*QuietEars().positions, 1.0, -0.35, 0.45)
    ears = QuietEars(weight=1.0, positions=everyone, temperatures=(14.0, 30.0))
    return best_mode().but(method=Free(effort=3e-3, power=0.01), convergence=1.0, quiet_ears=ears, ears=110.0)


MODES: Mapping[Mode, Callable[[], Settings]] = MappingProxyType(
    {"paper": paper_mode, "best": best_mode, "quick": quick_mode, "finest": finest_mode, "quiet": quiet_mode}
)
"""Function that makes the settings of each mode."""


def with_paper_mode(mode: Mode, paper: Settings, other: Settings | None = None) -> dict[str, Settings]:
    """Return the settings of the paper's mode and of another mode by name, paper first.

    `mode` "paper" returns the first alone. Without `other`, the other mode takes the air of the first, since both are
    played in the same room.
    """
    return (
        {"paper": paper}
        if mode == "paper"
        else {"paper": paper, mode: other or MODES[mode]().but(acoustics=paper.acoustics)}
    )


def with_fewer_points(settings: Settings, points: int) -> Settings:
    """Return the settings with `points` rows and columns of control points over the same square, for a preview."""
    grid = settings.target.grid
    pitch = grid.pitch * (grid.rows - 1) / (points - 1)
    return settings.but(grid=replace(grid, rows=points, columns=points, pitch=pitch))
