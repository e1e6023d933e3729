"""Everything that can be chosen on the way from what a sensor said to what an array is told, said once.

The command line's options, what a drive's provenance keeps and the table of the documentation come from here.
"""

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import from_plain, to_plain, whole_file
from midair.model import Acoustics, ControlGrid, Provenance, Setting
from midair.physics import TransducerDynamics
from midair.solvers import Amplitudes, Fit, Guard, Method, name_of
from midair.solvers import solver as solver_of
from midair.targets import Circle, Interpolated

Mode = Literal["paper", "best", "quick"]
"""The paper's own way; the best that midair can; the best with fewer iterations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """From what the sensor said to pressure.

    Attributes
    ----------
    band : tuple of float
        (low, high) of the frequencies that are kept, in Hz (3).
    inverse : {"fft", "fir"}
        How the channels' responses are undone: a zero-phase FFT, or a linear-phase FIR filter.
    """

    band: tuple[float, float] = (20.0, 470.0)
    inverse: Literal["fft", "fir"] = "fft"


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSettings:
    """From pressure to the sound that is wanted.

    Attributes
    ----------
    rate : float
        Frames per second of the drive, in Hz: the ultrasound's 40 kHz over a whole number (3).
    mapping : str
        From signed pressure to pressure that pushes (4.1); "slow-bias" distorts least.
    interpolate : {"amplitude", "pressure"}
        What is interpolated between the cells (4.1).
    gain : float
        Multiplies the pressure (5.2).
    grid : ControlGrid
        The control points (4.1).
    circle : Circle or None
        Moves the pattern slowly on a circle, for touch below 20 Hz; not in the paper and not validated on people.
    """

    rate: float = 1000.0
    mapping: str = "half-wave"
    interpolate: Interpolated = "amplitude"
    gain: float = 1.0
    grid: ControlGrid = field(default_factory=ControlGrid)
    circle: Circle | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CompensationSettings:
    """What later stages take away, and is put on beforehand; the paper did none of it.

    Attributes
    ----------
    decouple : bool
        Whether to undo that a cell also feels what is played for its neighbours.
    precompensate : bool
        Whether to undo what holding frames and the transducers' envelope make quieter.
    compensate : {"sound", "pressure"}
        Where: on the sound's amplitude at all frequencies, or on the pressure within 20-480 Hz.
    dynamics : TransducerDynamics
        The envelope that is undone.
    ramp : float
        The silencer's ramp that is undone, in s.
    """

    decouple: bool = False
    precompensate: bool = False
    compensate: Literal["sound", "pressure"] = "sound"
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    ramp: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings:
    """From the sound that is wanted to what the array is told; arguments of `midair.solve`.

    Attributes
    ----------
    method : str or a solver
        A name in `solvers.METHODS`, or a configured solver of `midair.solvers` (4.2).
    iterations : int or tuple of int or None
        At most, (first frame, later frames); the method's own if None (5.2).
    start : {"previous", "zero"} or None
        Where a frame starts from (4.2); the solver's own, "previous" unless configured, if None.
    level : float or "auto"
        Drive of every transducer, 0 to 1: the equal amplitude A (4.2); "auto" takes what the loudest frame needs.
    amplitudes : {"equal", "bounded"}
        All transducers at that level, as in the paper; or each at its own up to it.
    guard : float or Guard or None
        Keeps a ring around the control points quiet, by its width in m or as a term; not in the paper.
    fit : {"points", "cells"} or Cells
        Whether the control points are met, as in the paper, or the sensor's cells.
    smooth : float
        Weight of the change of phase from frame to frame; not in the paper.
    backend : str or None
        What does the arithmetic of method "fast"; NumPy if None.
    """

    method: str | Method = "exact"
    iterations: int | tuple[int, int] | None = None
    start: Literal["previous", "zero"] | None = None
    level: float | Literal["auto"] = 1.0
    amplitudes: Amplitudes = "equal"
    guard: float | Guard | None = None
    fit: Fit = "points"
    smooth: float = 0.0
    backend: str | None = None

    @property
    def name(self) -> str:
        """Of the method."""
        return self.method if isinstance(self.method, str) else type(self.method).__name__

    def arguments(self) -> dict[str, Any]:
        """As keyword arguments of `midair.solve`."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Every choice, in the order of the way; the defaults are the paper's.

    The solver is the paper's Levenberg-Marquardt in its cheaper form, in the modes of the field above .5 % of the
    strongest; method "lm" is the paper's to the letter.

    Attributes
    ----------
    calibration : CalibrationSettings
        From what the sensor said to pressure.
    target : TargetSettings
        From pressure to the sound that is wanted.
    compensation : CompensationSettings
        What is put on beforehand.
    solver : SolverSettings
        From the sound that is wanted to what the array is told.
    acoustics : Acoustics
        The air (2.1) and the directivity of a transducer (2.2).
    """

    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
    target: TargetSettings = field(default_factory=TargetSettings)
    compensation: CompensationSettings = field(default_factory=CompensationSettings)
    solver: SolverSettings = field(default_factory=SolverSettings)
    acoustics: Acoustics = field(default_factory=Acoustics)

    def but(self, **changes: Any) -> "Settings":
        """The same with other choices, by the names that they have in their groups: ``but(rate=4000.0, gain=2.0)``.

        Raises
        ------
        InputError
            If there is no such choice.
        """
        if "acoustics" in changes:
            return replace(self, acoustics=changes.pop("acoustics")).but(**changes)
        if unknown := sorted(set(changes) - set(_GROUPS)):
            known = ", ".join([*_GROUPS, "acoustics"])
            raise InputError(f"settings: expected some of {known}, got {', '.join(unknown)}")
        groups: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            groups.setdefault(_GROUPS[name], {})[name] = value
        return replace(self, **{group: replace(getattr(self, group), **some) for group, some in groups.items()})

    def plain(self) -> dict[str, Any]:
        """As nested dicts of numbers and texts, without what is None; `from_plain` makes it again.

        Raises
        ------
        InputError
            If there is a term that has no text: a fit to cells with a sensor of their own.
        """
        # Cells of a sensor of their own are arrays: a drive made with them cannot be made again from text.
        if not isinstance(self.solver.fit, str):
            raise InputError('fit: expected "points" or "cells" to be written down, got cells of a sensor of their own')
        made: dict[str, Any] = to_plain(self)
        if not isinstance(self.solver.method, str):
            made["solver"]["method"] = {"name": name_of(self.solver.method)} | made["solver"]["method"]
        return made

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> "Settings":
        """The settings that `plain` gave; what is left out is the paper's.

        Raises
        ------
        InputError
            If a name or a value is none of a setting's.
        """
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
        """Write them as TOML.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        import tomli_w

        with whole_file(path) as file:
            file.write_text(tomli_w.dumps(self.plain()), encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Settings":
        """The settings of a TOML file that `save` or a person wrote.

        Raises
        ------
        MissingFileError, BrokenFileError
            If there is no such file, or no TOML of settings in it.
        """
        try:
            return cls.from_plain(tomllib.loads(Path(path).read_text(encoding="utf-8")))
        except OSError as wrong:
            raise MissingFileError(f"{path}: expected settings in TOML, got {wrong.strerror}") from wrong
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, InputError) as wrong:
            raise BrokenFileError(f"{path}: expected settings in TOML, got: {wrong}") from wrong

    def noted(self, provenance: Provenance) -> Provenance:
        """A provenance with all of them as a step, so that the result can be made again, where they have a text."""
        if not isinstance(self.solver.fit, str):
            return provenance
        return provenance.then("settings", _flat(self.plain()))

    @classmethod
    def of(cls, provenance: Provenance) -> "Settings | None":
        """The settings by which something was made; None where its provenance does not tell."""
        for step in reversed(provenance.steps):
            if step.stage == "settings":
                return cls.from_plain(_nested(step.settings))
        return None


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
"""In which group each choice is."""


def paper_mode() -> Settings:
    """As the paper describes it: half-wave rectification, 1 kHz, the control points alone (4.1, 4.2, 5.2)."""
    return Settings()


def best_mode() -> Settings:
    """A slow bias in place of rectification, 4 kHz, a guard around the square, phases that move slowly.

    What interpolation mixes between neighbouring cells, and what hold and transducers make quieter, is undone before.
    """
    return Settings().but(
        method="fast",
        mapping="slow-bias",
        rate=4000.0,
        precompensate=True,
        interpolate="pressure",
        decouple=True,
        guard=Guard(margin=25e-3, pitch=6e-3, ceiling=0.6),
        smooth=0.2,
    )


def quick_mode() -> Settings:
    """The best mode with fewer iterations."""
    return best_mode().but(iterations=12)


MODES: Mapping[Mode, Callable[[], Settings]] = MappingProxyType(
    {"paper": paper_mode, "best": best_mode, "quick": quick_mode}
)
"""Settings by name."""


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
            value = getattr(value, part, None) if part != "margin" or not isinstance(value, int | float) else value
        return value

    def put(self, settings: Settings, value: Any) -> Settings:
        """The settings with it.

        A radius or a margin of 0 switches a circle or a guard off, any other switches it on.

        Raises
        ------
        InputError
            If the value is out of range, or it belongs to something that is off.
        """
        _, name, *inner = self.path.split(".")
        if not inner:
            return self._acoustic(settings, value) if name == "directivity" else settings.but(**{name: value})
        part = getattr(getattr(settings, self.path.split(".")[0]), name)
        if name in _SWITCHED and inner[0] == _SWITCHED[name][0]:
            if value == 0:
                return settings.but(**{name: None})
            part = part if isinstance(part, Guard | Circle) else _SWITCHED[name][1]()
        if part is None:
            raise InputError(f"--{self.name}: expected --{name} beside it, got none")
        changes = dict.fromkeys(("rows", "columns") if inner[0] == "rows" else inner, value)
        return settings.but(**{name: replace(part, **changes)})

    @staticmethod
    def _acoustic(settings: Settings, value: Any) -> Settings:
        return settings.but(acoustics=replace(settings.acoustics, directivity=value))


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
        help="Where: on the sound at all frequencies, or on the pressure within 20 to 480 Hz.",
    ),
    Choice(name="method", path="solver.method", help="The solver; lm is the paper's, exact its cheaper form."),
    Choice(
        name="iterations",
        path="solver.iterations",
        help="At most, for the first frame and for each later one; 50 and 20 in the paper.",
    ),
    Choice(name="start", path="solver.start", help="Where a frame starts: from the one before, or zero."),
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
    Choice(name="fit", path="solver.fit", help="Whether the control points are met, or the sensor's cells."),
    Choice(
        name="smooth", path="solver.smooth", help="Weight of the change of phase from frame to frame; 0.01 is much."
    ),
    Choice(
        name="backend",
        path="solver.backend",
        help="What does the arithmetic of fast: numpy, torch, torch:cuda or cupy.",
    ),
    Choice(name="directivity", path="acoustics.directivity", help="Of a transducer."),
)
"""What can be chosen by name, in the order of the way."""


def spelt(value: Any, unit: str = "") -> str:
    """A value as a person would type it: lengths in millimetres, yes and no, nothing for a solver's own choice."""
    if value is None:
        return "none" if unit else "its own"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return " ".join(spelt(each, unit) for each in value)
    if unit == "m":
        return f"{1e3 * value:.6g}mm"
    return f"{value:.6g}{unit}" if unit or isinstance(value, float) else str(value)


def choices_table() -> str:
    """The table of the documentation: every choice, its place in `Settings`, what it is, its value in each mode.

    A mode's value is left out where it is that of the mode before it.
    """
    lines = ["| option, in `Settings` | what | paper | best | quick |", "| --- | --- | --- | --- | --- |"]
    for choice in CHOICES:
        paper, best, quick = (spelt(choice.of(MODES[mode]()), choice.unit) for mode in ("paper", "best", "quick"))
        said = f"{paper} | {best if best != paper else ''} | {quick if quick != best else ''}"
        lines.append(f"| `--{choice.name}`<br>`{choice.path}` | {choice.help} | {said} |")
    return "\n".join(lines)


def beside_paper(mode: Mode, paper: Settings, other: Settings | None = None) -> dict[str, Settings]:
    """The paper's mode and another one by their names, paper first; the paper's alone if that is the other one.

    Parameters
    ----------
    mode : {"paper", "best", "quick"}
        The other one.
    paper : Settings
        Of the paper's mode.
    other : Settings, optional
        In place of the other mode's own.
    """
    return {"paper": paper} if mode == "paper" else {"paper": paper, mode: other or MODES[mode]()}


def coarser(settings: Settings, points: int) -> Settings:
    """The same with fewer control points over the same square, for a quick look."""
    grid = settings.target.grid
    pitch = grid.pitch * (grid.rows - 1) / (points - 1)
    return settings.but(grid=replace(grid, rows=points, columns=points, pitch=pitch))


def _flat(values: Mapping[str, Any], before: str = "") -> dict[str, Setting]:
    """Nested names joined by dots, as provenance holds them."""
    flat: dict[str, Setting] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{before}{name}.")  # pyright: ignore[reportUnknownArgumentType]
        else:
            flat[f"{before}{name}"] = tuple(value) if isinstance(value, list) else value
    return flat


def _nested(flat: Mapping[str, Setting]) -> dict[str, Any]:
    """What `_flat` joined, apart again."""
    nested: dict[str, Any] = {}
    for name, value in flat.items():
        *groups, last = name.split(".")
        inner = nested
        for group in groups:
            inner = inner.setdefault(group, {})
        inner[last] = value
    return nested
