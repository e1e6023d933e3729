"""Everything that can be chosen on the way from a sensor to an array, in groups, as one value."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Literal

from midair.errors import BrokenFileError, InputError
from midair.files import from_plain, read_toml, to_plain, whole_file
from midair.model import Acoustics, ArrayCalibration, ControlGrid, Medium, Provenance, Setting
from midair.physics import TransducerDynamics
from midair.solvers import Amplitudes, Fit, Guard, Method, QuietPalm, name_of
from midair.solvers import solver as solver_of
from midair.targets import Circle, Interpolated


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


STRONGEST = 10.0
"""Highest strength that can be asked for: ten times what any array can make."""


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
    strength : float or None
        Peak of the target's sound over that of one focus of the whole array at full drive; it takes the place of the
        gain. None for the gain as it is.
    grid : ControlGrid
        The control points (4.1).
    circle : Circle or None
        Moves the pattern slowly on a circle, for touch below 20 Hz; not in the paper and not validated on people.
    """

    rate: float = 1000.0
    mapping: str = "half-wave"
    interpolate: Interpolated = "amplitude"
    gain: float = 1.0
    strength: float | None = None
    grid: ControlGrid = field(default_factory=ControlGrid)
    circle: Circle | None = None

    def __post_init__(self) -> None:
        if self.strength is not None and not 0 < self.strength <= STRONGEST:
            raise InputError(
                f"strength: expected above 0 and up to {STRONGEST:g} of one focus of the whole array, got "
                f"{self.strength:g}; .15 is usual"
            )


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
    fit : {"points", "windows", "cells"}, Windows or Cells
        Whether the control points are met, as in the paper; windows, wherever a palm or a sensor lies; or the cells of
        a sensor in one place alone.
    smooth : float
        Weight of the change of phase from frame to frame; not in the paper.
    robust : float
        Degrees Celsius by which the air may be colder or warmer than that of the settings; not in the paper.
    quiet_ears : float
        Weight of the sound at the ears of a person in front of the array; not in the paper.
    quiet_palm : float or QuietPalm
        Weight of the sound on a palm around the control points, or the term with an outline; not in the paper.
    backend : str or None
        What does the arithmetic of methods "fast" and "glide"; NumPy if None.
    jobs : int or None
        Blocks of method "glide" that are solved at once, 1 if None; it changes nothing but the time.
    """

    method: str | Method = "exact"
    iterations: int | tuple[int, int] | None = None
    start: Literal["previous", "zero"] | None = None
    level: float | Literal["auto"] = 1.0
    amplitudes: Amplitudes = "equal"
    guard: float | Guard | None = None
    fit: Fit = "points"
    smooth: float = 0.0
    robust: float = 0.0
    quiet_ears: float = 0.0
    quiet_palm: float | QuietPalm = 0.0
    backend: str | None = None
    # Settings that differ in it alone give the same.
    jobs: int | None = field(default=None, compare=False)

    @property
    def name(self) -> str:
        """Of the method."""
        return name_of(self.method)

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

    def measured(self, calibration: ArrayCalibration) -> "Settings":
        """The same for an array that was measured: what its transducers make quieter on average is undone."""
        pole = calibration.pole[~calibration.dead].mean()
        return self.but(dynamics=TransducerDynamics(time_constant=float(-1 / pole.real), detuning=float(pole.imag)))

    def plain(self) -> dict[str, Any]:
        """As nested dicts of numbers and texts, without what is None; `from_plain` makes it again.

        Raises
        ------
        InputError
            If there is a term that has no text: a fit to cells or windows with settings of their own.
        """
        # Cells of a sensor of their own are arrays: a drive made with them cannot be made again from text.
        if not isinstance(self.solver.fit, str):
            raise InputError(
                'fit: expected "points", "windows" or "cells" to be written down, got one with settings of its own'
            )
        made: dict[str, Any] = to_plain(self)
        if not isinstance(self.solver.method, str):
            made["solver"]["method"] = {"name": name_of(self.solver.method)} | made["solver"]["method"]
        return made

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> "Settings":
        """The settings that `plain` gave; what is left out is the paper's.

        A medium of which only temperature, humidity and alpha are told is `Medium.at` them.

        Raises
        ------
        InputError
            If a name or a value is none of a setting's.
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
        plain = read_toml(path, "settings in TOML")
        try:
            return cls.from_plain(plain)
        except InputError as wrong:
            raise BrokenFileError(f"{path}: expected settings in TOML, got: {wrong}") from wrong

    def noted(self, provenance: Provenance) -> Provenance:
        """A provenance with all of them as a step, so that the result can be made again, where they have a text."""
        if not isinstance(self.solver.fit, str):
            return provenance
        # How many cores there were is no part of how a result is made.
        return provenance.then("settings", _flat(self.but(jobs=None).plain()))

    @classmethod
    def of(cls, provenance: Provenance) -> "Settings | None":
        """The settings by which something was made; None where its provenance does not tell."""
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
"""In which group each choice is."""


def _with_air(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The same with all of a medium that a person told by its temperature: without it, sound would be as slow as at 14.

    What is no mapping or no number is left as it is, for `from_plain` to say so.
    """
    acoustics: Any = values.get("acoustics")
    medium: Any = acoustics.get("medium") if isinstance(acoustics, Mapping) else None
    told = {"temperature", "humidity", "alpha"}
    if not isinstance(medium, Mapping) or "temperature" not in medium or not set(medium) <= told:
        return values
    if not all(isinstance(each, int | float) for each in medium.values()):
        return values
    return {**values, "acoustics": {**acoustics, "medium": to_plain(Medium.at(**medium))}}


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
