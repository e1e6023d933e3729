"""Patterns of moving foci as one tree of dataclasses, whose fields are the keys of a TOML file.

::

    rate_hz = 4000
    duration_s = 1.0            # leave it out for a loop

    [[spot]]
    shape = { name = "circle", radius_mm = 15 }
    draw_hz = 50
    pressure_pa = 60
    am = { frequency_hz = 150, depth = 1.0 }
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError, InputError
from midair.files import check_memory_for, from_plain, read_toml, to_plain
from midair.model import HEIGHT, HEIGHTS
from midair.patterns.drawing import Foci
from midair.patterns.shapes import SHAPES, Points, Shape
from midair.validation import Declared, check_settings, setting

FASTEST = 8000.0
"""Highest frame rate in Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeModulation(Declared):
    """Factor 1 - depth / 2 + depth / 2 cos(2 pi f t) on the pressure: its line at f is depth / 2 of the peak."""

    frequency_hz: float = setting(150.0, "Frequency of the pressure.", unit="Hz", limits=(0, FASTEST / 2), above=True)
    depth: float = setting(1.0, "Part of the pressure that vibrates; 1 goes down to silence.", limits=(0, 1))

    def __post_init__(self) -> None:
        check_settings(self)

    def factor(self, time: Array) -> Array:
        """Factor on the pressure at times in s."""
        return 1 - self.depth / 2 + self.depth / 2 * np.cos(2 * np.pi * self.frequency_hz * time)


@dataclass(frozen=True, slots=True, kw_only=True)
class LateralModulation(Declared):
    """A small orbit around the moving place, in equal steps.

    Foci on an orbit at 5 to 15 Hz in steps below 1 mm are felt as static pressure (Morisaki et al., IEEE Trans.
    Haptics, 2022); that is their result, not checked here.
    """

    frequency_hz: float = setting(5.0, "Turns per second.", unit="Hz", limits=(0, 100), above=True)
    radius_mm: float = setting(3.0, "Radius of the orbit.", unit="mm", limits=(0, 20), above=True)
    step_mm: float = setting(0.0, "Longest step along the orbit; 0 moves with every frame.", unit="mm", limits=(0, 20))

    def __post_init__(self) -> None:
        check_settings(self)

    def offset(self, time: Array) -> Array:
        """Way from the centre at times in s, shape (frame, 2), in mm."""
        turns = self.frequency_hz * time
        if self.step_mm:
            steps = np.ceil(2 * np.pi * self.radius_mm / self.step_mm)
            turns = np.floor(turns * steps + 1e-6) / steps
        angle = 2 * np.pi * turns
        return self.radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot(Declared):
    """One focus: where it moves, and how hard it presses."""

    shape: Shape = setting(Points, "Path around the centre.")
    centre_mm: tuple[float, float] = setting((0.0, 0.0), "Centre, from that of the array.", unit="mm")
    above_mm: float = setting(0.0, "Height above the palm.", unit="mm", limits=(-200, 200))
    turn_deg: float = setting(0.0, "Rotation of the path, counter-clockwise.", unit="deg", limits=(-720, 720))
    pressure_pa: float = setting(50.0, "Highest pressure on the palm.", unit="Pa", limits=(0, 1e4))
    draw_hz: float = setting(0.0, "Times per second that the path is drawn.", unit="Hz", limits=(0, FASTEST / 2))
    speed_m_s: float = setting(0.0, "Speed along the path, in place of draw_hz.", unit="m/s", limits=(0, 1000))
    positions: int = setting(0, "Number of places on the path; 0 moves with every frame.", limits=(0, 100_000))
    am: AmplitudeModulation | None = setting(None, "Amplitude modulation.")
    lm: LateralModulation | None = setting(None, "Lateral modulation.")
    start_s: float = setting(0.0, "Time at which it begins.", unit="s", limits=(0, np.inf))
    stop_s: float = setting(np.inf, "Time at which it ends.", unit="s", limits=(0, np.inf), above=True)

    def __post_init__(self) -> None:
        check_settings(self)
        if self.draw_hz and self.speed_m_s:
            raise InputError("speed_m_s: expected draw_hz or speed_m_s, got both; leave out one of them")
        if not np.isfinite(self.centre_mm).all():
            raise InputError(f"centre_mm: expected finite numbers, got {self.centre_mm}")

    def rate(self) -> float:
        """Times per second that the path is drawn, there and back for an open one."""
        there = (1 if self.shape.closed else 2) * self.shape.length() if self.speed_m_s else 0.0
        return 1e3 * self.speed_m_s / there if there else self.draw_hz

    def places(self, time: Array) -> Array:
        """Places relative to the centre of the palm at times in s, shape (frame, 3), in m."""
        share = np.mod(self.rate() * (time - self.start_s) + 1e-9, 1.0)
        if not self.shape.closed:
            share = 1 - np.abs(1 - 2 * share)
        if self.positions:
            last = self.positions if self.shape.closed else max(self.positions - 1, 1)
            share = np.floor(np.minimum(share * self.positions + 1e-6, last)) / last
        turn = np.radians(self.turn_deg)
        turned = self.shape.at(share) @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        if self.lm is not None:
            turned = turned + self.lm.offset(time - self.start_s)
        flat = turned + np.array(self.centre_mm)
        return 1e-3 * np.column_stack([flat, np.full(len(flat), self.above_mm)])

    def pressure(self, time: Array) -> Array:
        """Pressure at times in s, shape (frame,), in Pa; 0 before its start and from its end on."""
        sounds = (time >= self.start_s - 1e-9) & (time < self.stop_s - 1e-9)
        modulation = 1.0 if self.am is None else self.am.factor(time - self.start_s)
        return np.asarray(self.pressure_pa * sounds * modulation, float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pattern(Declared):
    """Spots that are drawn at once."""

    spot: tuple[Spot, ...] = (Spot(),)
    name: str = setting("", "Name of the pattern.")
    rate_hz: float = setting(4000.0, "Frames per second.", unit="Hz", limits=(1, FASTEST))
    duration_s: float | None = setting(None, "Length of one pass; none: a loop.", unit="s", limits=(0, 1e5), above=True)
    height_mm: float = setting(
        1e3 * HEIGHT, "Palm above the array.", unit="mm", limits=(1e3 * HEIGHTS[0], 1e3 * HEIGHTS[1])
    )

    def __post_init__(self) -> None:
        check_settings(self)
        for number, spot in enumerate(self.spot, 1):
            for name, asked in (("draw_hz", spot.rate()), ("am.frequency_hz", spot.am.frequency_hz if spot.am else 0)):
                if asked > self.rate_hz / 2:
                    raise InputError(
                        f"spot {number}: {name}: expected at most {self.rate_hz / 2:g} Hz, half of rate_hz, got "
                        f"{asked:g} Hz"
                    )

    def foci(self, duration: float | None = None) -> Foci:
        """The foci of every frame for `duration` in s, one pass if None. Raises InputError for a loop without one."""
        seconds = self.duration_s if duration is None else duration
        if seconds is None:
            raise InputError("duration: expected a time, since the pattern is a loop; give --duration or duration_s")
        frames = max(round(seconds * self.rate_hz), 1)
        check_memory_for(100.0 * frames * len(self.spot), f"{seconds:g} s of the pattern", "make it shorter")
        time = np.arange(frames) / self.rate_hz
        position = np.stack([spot.places(time) for spot in self.spot], axis=1)
        return Foci(
            position=position + np.array([0, 0, 1e-3 * self.height_mm]),
            pressure=np.stack([spot.pressure(time) for spot in self.spot], axis=1),
            rate=self.rate_hz,
        )

    def plain(self) -> dict[str, Any]:
        """Nested dicts and lists for TOML; `from_plain` reads them."""
        made: dict[str, Any] = to_plain(self)
        names = {SHAPES[name]: name for name in SHAPES}
        for table, spot in zip(made["spot"], self.spot, strict=True):
            table["shape"] = {"name": names[type(spot.shape)]} | table["shape"]
        return made

    @classmethod
    def from_plain(cls, values: Mapping[str, Any]) -> "Pattern":
        """Build a pattern from the dicts of its TOML file. Raises InputError that names the invalid key."""
        tables: Any = values.get("spot", [])
        if not (isinstance(tables, list) and tables and all(isinstance(table, Mapping) for table in tables)):
            raise InputError("spot: expected one table [[spot]] or more, got none")
        spots: list[Spot] = []
        for number, table in enumerate(tables, 1):
            try:
                spots.append(from_plain(Spot, dict(table) | {"shape": _shape(table.get("shape", "points"))}))
            except InputError as wrong:
                raise InputError(f"spot {number}: {wrong}") from None
        return from_plain(cls, dict(values) | {"spot": tuple(spots)})


def _shape(table: Any) -> Shape:
    given: dict[str, Any] = dict(table) if isinstance(table, Mapping) else {"name": table}
    name = given.pop("name", None)
    if not isinstance(name, str) or name not in SHAPES:
        raise InputError(f"shape: expected one of {', '.join(SHAPES)} as name, got {name!r}")
    return from_plain(SHAPES[name], given, where="shape.")


def load_pattern(path: str | os.PathLike[str]) -> Pattern:
    """Read a pattern from a TOML file. Raises MissingFileError, or BrokenFileError if a key or a value is invalid."""
    content = read_toml(path, "a pattern in TOML")
    try:
        return Pattern.from_plain(content)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong
