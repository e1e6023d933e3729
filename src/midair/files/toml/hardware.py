"""Sensors, motion stages, trackers, arrays, palms and laboratories as users describe them in TOML.

Keys end in their unit. Rotations are about the fixed x, then y, then z axis. A stage is in machine coordinates, as
after ``MPos:`` in a status report of Grbl; units of an array come in the order of their wiring, each by its first
transducer; a tracker's own coordinates are x to the right, y away from the person, z up. The documentation shows a
file of each kind: build-a-sensor.md, data/stage.toml, play-on-your-array.md, follow.md and palm.md.
"""

import os
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
import scipy
import tomli_w

from midair.errors import InputError
from midair.files.atomic import write_file
from midair.files.toml.exposure_profiles import in_si, read_sheet
from midair.model import Heading, Palm, Placement, SensorGrid, SensorWiring, StageSetup, TrackerPlacement, Unit
from midair.validation import Declared, check_settings, setting, within

Place = tuple[float, float, float]
PathLike = str | os.PathLike[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSheet:
    """Keys of a sensor."""

    name: str
    rows: int = 4
    columns: int = 4
    pitch_mm: float = 11.0
    unit: Unit = "count"
    full_scale: float | None = None
    sensitivity: float | None = None
    order: tuple[int, ...] = ()


def load_sensor(path: PathLike) -> SensorWiring:
    """Read a sensor; the defaults are 4 x 4 cells at 11 mm, in counts. Raises the errors of `read_sheet`."""

    def wiring(keys: SensorSheet) -> SensorWiring:
        known = in_si(keys)
        grid = SensorGrid(**{name: known.pop(name) for name in ("name", "rows", "columns", "pitch")})
        return SensorWiring(grid=grid, **known)

    return read_sheet(path, "a TOML file that describes a sensor", SensorSheet, wiring)


def save_sensor(sensor: SensorWiring, path: PathLike) -> None:
    """Write a sensor file atomically. Raises FileError if the file cannot be written."""
    grid = sensor.grid
    keys: dict[str, Any] = {name: getattr(grid, name) for name in ("name", "rows", "columns")}
    keys |= {"pitch_mm": float(f"{grid.pitch * 1e3:.12g}")}
    keys |= {name: getattr(sensor, name) for name in ("unit", "full_scale", "sensitivity")}
    head = tomli_w.dumps({name: value for name, value in keys.items() if value is not None})
    rows = "".join(f"  {', '.join(map(str, row))},\n" for row in np.reshape(sensor.order, grid.shape).tolist())
    write_file(path, f"{head}# Channel of the source for each cell, row by row.\norder = [\n{rows}]\n")


@dataclass(frozen=True, slots=True, kw_only=True)
class TravelSheet:
    """Keys of the table [travel] of a stage."""

    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    z_mm: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class StageSheet:
    """Keys of a stage."""

    heading: Heading
    start_mm: tuple[float, float]
    contact_mm: float
    clear_mm: float
    approach_mm_s: float
    return_mm_s: float
    travel: TravelSheet
    homing: Literal["switches", "by hand"] = "switches"


def load_stage(path: PathLike) -> StageSetup:
    """Read the set-up of a motion stage. Raises the errors of `read_sheet`."""

    def setup(keys: StageSheet) -> StageSetup:
        known = in_si(keys)
        known["travel"] = tuple(in_si(keys.travel).values())
        return StageSetup(back=known.pop("return"), **known)

    return read_sheet(path, "a TOML file that describes a motion stage", StageSheet, setup)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitSheet:
    """Keys of a unit of an array."""

    position_mm: Place
    rotation_deg: Place = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementSheet:
    """Keys of a placement of units."""

    name: str
    unit: tuple[UnitSheet, ...]


def load_placement(path: PathLike) -> Placement:
    """Read the placement of an array's units. Raises the errors of `read_sheet`."""

    def placement(keys: PlacementSheet) -> Placement:
        units = [in_si(unit) for unit in keys.unit]
        position, rotation = (np.array([unit[name] for unit in units]) for name in ("position", "rotation"))
        return Placement(position=position, rotation=rotation, name=keys.name)

    return read_sheet(path, "a TOML file with the placement of the units", PlacementSheet, placement)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSheet:
    """Keys of a tracker."""

    rotation_deg: Place = (0.0, 0.0, 0.0)
    offset_mm: Place = (0.0, 0.0, 0.0)
    uncertainty_mm: float = 0.0


def load_tracker(path: PathLike) -> TrackerPlacement:
    """Read the placement of a tracker. Raises the errors of `read_sheet`."""

    def placement(keys: TrackerSheet) -> TrackerPlacement:
        known = in_si(keys)
        turns = scipy.spatial.transform.Rotation.from_euler("xyz", known.pop("rotation"))
        return TrackerPlacement(rotation=turns.as_matrix(), **known)

    return read_sheet(path, "a TOML file with the placement of a tracker", TrackerSheet, placement)


def save_tracker(placement: TrackerPlacement, path: PathLike) -> None:
    """Write the placement of a tracker atomically. Raises FileError if the file cannot be written."""
    turns = scipy.spatial.transform.Rotation.from_matrix(placement.rotation).as_euler("xyz", degrees=True)
    keys = {
        "rotation_deg": np.round(turns, 6).tolist(),
        "offset_mm": np.round(1e3 * placement.offset, 4).tolist(),
        "uncertainty_mm": round(1e3 * placement.uncertainty, 4),
    }
    write_file(path, tomli_w.dumps(keys))


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory(Declared):
    """Standard uncertainties (k = 1), for the palm and the units along each axis; InputError if out of range."""

    palm_aside_mm: float = setting(3.0, "Position of the palm, sideways.", limits=(0, 100))
    palm_height_mm: float = setting(3.0, "Height of the palm.", limits=(0, 100))
    palm_tilt_deg: float = setting(5.0, "Tilt of the palm.", limits=(0, 60))
    palm_turn_deg: float = setting(5.0, "Rotation of the palm about its normal.", limits=(0, 90))
    temperature_k: float = setting(1.0, "Air temperature minus the stated one.", limits=(0, 15))
    unit_position_mm: float = setting(0.5, "Position of each unit.", limits=(0, 10))
    unit_angle_deg: float = setting(0.3, "Rotation of each unit.", limits=(0, 10))
    strength: float = setting(0.05, "Strength of each transducer, relative.", limits=(0, 1))
    resonance_hz: float = setting(180.0, "Resonance of each transducer; 180 Hz: .2 rad.", limits=(0, 2000))
    dead: float = setting(0.01, "Share of the transducers that are silent.", limits=(0, 0.5))
    frequency: float = setting(1e-4, "Frequency of the ultrasound, relative.", limits=(0, 0.02))
    reflection: float = setting(0.5, "Reflection factor of the array's face for sound from the palm.", limits=(0, 1))

    def __post_init__(self) -> None:
        check_settings(self)


def load_laboratory(path: PathLike) -> Laboratory:
    """Read the uncertainties of a laboratory; a missing key takes its default. Raises the errors of `read_sheet`."""
    return read_sheet(path, "a TOML file with the uncertainties of a laboratory", Laboratory)


def save_laboratory(laboratory: Laboratory, path: PathLike) -> None:
    """Write the uncertainties of a laboratory atomically, each with its meaning. Raises FileError if it fails."""
    lines = [f"{one.name} = {getattr(laboratory, one.name)!r}  # {one.metadata['help']}" for one in fields(laboratory)]
    head = "# Standard uncertainties (k = 1) of a laboratory, for midair budget --lab. Replace what you know better."
    write_file(path, "\n".join([head, *lines]) + "\n")


@dataclass(frozen=True, slots=True, kw_only=True)
class PalmSheet:
    """Keys of the file of a palm."""

    name: str
    disc_mm: float | None = None
    outline_mm: tuple[tuple[float, float], ...] | None = None
    pitch_mm: float = 2.5


def load_palm(path: PathLike) -> Palm:
    """Read a palm. Raises the errors of `read_sheet`."""

    def palm(keys: PalmSheet) -> Palm:
        pitch, name = within(keys.pitch_mm, "pitch_mm", 0.2, 20, unit="mm") * 1e-3, keys.name
        if (keys.disc_mm is None) == (keys.outline_mm is None):
            got = "none" if keys.disc_mm is None else "both"
            raise InputError(f"expected one of disc_mm and outline_mm, got {got}")
        if keys.disc_mm is not None:
            return Palm(inside=Palm.disc(keys.disc_mm * 1e-3, pitch=pitch).inside, pitch=pitch, name=name)
        return Palm.within(np.array(keys.outline_mm) * 1e-3, pitch=pitch, name=name)

    return read_sheet(path, "a TOML file with the outline of a palm", PalmSheet, palm)
