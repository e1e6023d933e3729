"""Patterns of moving foci as one tree of dataclasses, whose fields are the keys of a TOML file.

::

    duration_s = 1.0            # leave it out for a loop

    [[spot]]
    shape = { name = "circle", radius_mm = 15 }
    draw_hz = 50
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.array_types import Array
from midair.dsp import resample
from midair.errors import BrokenFileError, InputError, UnitError
from midair.files import check_memory_for, from_plain, open_take, read_text, read_toml, save_solutions
from midair.model import HEIGHT, HEIGHTS, Acoustics, Medium, Progress, Provenance, TransducerArray
from midair.patterns.adaptics import MOST_KEYS, AdapticsPattern, check_count, check_parameters, load_adaptics
from midair.patterns.drawing import Foci, check_reach, draw_parts, drawn_settings, wanted_amplitude
from midair.patterns.shapes import SHAPES, Checked, Points, Shape, on_circle
from midair.targets import PACINIAN, receptor_pressure
from midair.validation import setting

FASTEST = 8000.0
"""Highest frame rate in Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeModulation(Checked):
    """Factor 1 - depth / 2 + depth / 2 cos(2 pi f t) on the pressure: its line at f is depth / 2 of the peak."""

    frequency_hz: float = setting(150.0, "Frequency of the pressure.", unit="Hz", limits=(0, FASTEST / 2), above=True)
    depth: float = setting(1.0, "Part of the pressure that vibrates; 1 goes down to silence.", limits=(0, 1))

    def factor(self, time: Array) -> Array:
        """Factor on the pressure at times in s."""
        return 1 - self.depth / 2 + self.depth / 2 * np.cos(2 * np.pi * self.frequency_hz * time)


@dataclass(frozen=True, slots=True, kw_only=True)
class LateralModulation(Checked):
    """A small orbit around the moving place, in equal steps.

    Foci on an orbit at 5 to 15 Hz in steps below 1 mm are felt as static pressure (Morisaki et al., IEEE Trans.
    Haptics, 2022); that is their result, not checked here.
    """

    frequency_hz: float = setting(5.0, "Turns per second.", unit="Hz", limits=(0, 100), above=True)
    radius_mm: float = setting(3.0, "Radius of the orbit.", unit="mm", limits=(0, 20), above=True)
    step_mm: float = setting(0.0, "Longest step along the orbit; 0 moves with every frame.", unit="mm", limits=(0, 20))

    def offset(self, time: Array) -> Array:
        """Way from the centre at times in s, shape (frame, 2), in mm."""
        turns = self.frequency_hz * time
        if self.step_mm:
            steps = np.ceil(2 * np.pi * self.radius_mm / self.step_mm)
            turns = np.floor(turns * steps + 1e-6) / steps
        return on_circle(self.radius_mm, turns)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalModulation(Checked):
    """Factor 1 - depth / 2 + depth / 2 s(t) on the pressure, s being a recorded signal with its peak at 1 or -1."""

    file: str = setting("", "Recording, wave or effect that midair import reads; repeated to the end of the spot.")
    channel: int | None = setting(None, "Channel, row by row; none: that with the widest range.", limits=(0, 100_000))
    depth: float = setting(1.0, "Part of the pressure that follows the signal.", limits=(0, 1))

    def factor(self, time: Array, rate: float) -> Array:
        """Factor on the pressure at times in s, of frames at `rate` in Hz; 1 before time 0.

        Raises InputError if the file has no such channel, or nothing changes in it.
        """
        try:
            recording = open_take(self.file).recording
        except UnitError:
            # The level counts for nothing.
            recording = open_take(self.file, unit="V").recording
        channels = np.asarray(recording.samples).reshape(recording.frames, -1)
        channel = int(np.ptp(channels, axis=0).argmax()) if self.channel is None else self.channel
        if channel >= (count := recording.sensor.count):
            raise InputError(f"signal.channel: expected 0 to {count - 1} of {self.file}, got {channel}")
        signal = channels[:, channel]
        signal = resample(signal - np.median(signal), recording.rate, rate)
        if not (peak := np.abs(signal).max()) > 0:
            raise InputError(f"signal.file: expected a signal that changes, got a constant in {self.file}")
        at = np.round(time * rate).astype(int)
        return np.where(at < 0, 1.0, 1 - self.depth / 2 + self.depth / 2 * signal[at % len(signal)] / peak)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceptorWeights(Checked):
    """Parts of the pressure for three kinds of receptors (`midair.targets.receptor_pressure`), 1 together at most.

    An orbit, `lm`, makes the slow part felt.
    """

    slow: float = setting(0.6, "Steady part.", limits=(0, 1))
    fast: float = setting(0.2, "Part that vibrates at 30 Hz.", limits=(0, 1))
    pacinian: float = setting(0.2, "Part that vibrates at pacinian_hz.", limits=(0, 1))
    pacinian_hz: float = setting(PACINIAN, "Frequency for Pacinian corpuscles.", unit="Hz", limits=(100, 300))

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if (total := self.slow + self.fast + self.pacinian) > 1 + 1e-9:
            raise InputError(f"receptors: expected slow, fast and pacinian with a sum of 1 at most, got {total:g}")

    def factor(self, time: Array) -> Array:
        """Factor on the pressure at times in s."""
        return receptor_pressure(self.slow, self.fast, self.pacinian, time, self.pacinian_hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Key(Checked):
    """Where the centre of a spot is at a time after its start, and which part of its pressure it has."""

    at_s: float = setting(0.0, "Time after the start of the spot.", unit="s", limits=(0, 1e5))
    centre_mm: tuple[float, float] = setting((0.0, 0.0), "Centre, from that of the spot.", unit="mm")
    part: float = setting(1.0, "Part of the pressure.", limits=(0, 1))
    ease: Literal["linear", "smooth", "step"] = setting("linear", "Way to the next key; a step holds until there.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot(Checked):
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
    receptors: ReceptorWeights | None = setting(
        None, "Steady pressure and two vibrations, for three kinds of receptors."
    )
    signal: SignalModulation | None = setting(None, "A recorded signal as the modulation.")
    key: tuple[Key, ...] = setting((), "Key frames in order of time; the last one holds.")
    loop_keys: bool = setting(False, "Whether the keys begin again after the last one.")
    start_s: float = setting(0.0, "Time at which it begins.", unit="s", limits=(0, np.inf))
    stop_s: float = setting(np.inf, "Time at which it ends.", unit="s", limits=(0, np.inf), above=True)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.draw_hz and self.speed_m_s:
            raise InputError("speed_m_s: expected draw_hz or speed_m_s, got both; leave out one of them")
        if not np.isfinite([self.centre_mm, *(key.centre_mm for key in self.key)]).all():
            raise InputError(f"centre_mm: expected finite numbers, got {self.centre_mm}")
        times = [key.at_s for key in self.key]
        if any(later <= earlier for earlier, later in pairwise(times)) or (self.loop_keys and len(times) < 2):
            raise InputError(f"key: expected at_s that increase, and two keys or more for loop_keys, got {times}")

    def rate(self) -> float:
        """Times per second that the path is drawn, there and back for an open one."""
        there = (1 if self.shape.closed else 2) * self.shape.length() if self.speed_m_s else 0.0
        return 1e3 * self.speed_m_s / there if there else self.draw_hz

    def keyed(self, time: Array) -> Array:
        """Way of the centre in mm, and part of the pressure, by the keys at times in s: shape (frame, 3)."""
        if not self.key:
            return np.tile([0.0, 0.0, 1.0], (len(time), 1))
        at = np.array([key.at_s for key in self.key])
        values = np.array([(*key.centre_mm, key.part) for key in self.key])
        since = time - self.start_s
        since = at[0] + np.mod(since - at[0], at[-1] - at[0]) if self.loop_keys else np.clip(since, at[0], at[-1])
        before = np.clip(np.searchsorted(at, since + 1e-9, "right") - 1, 0, max(len(at) - 2, 0))
        after = np.minimum(before + 1, len(at) - 1)
        share = np.clip((since + 1e-9 - at[before]) / np.maximum(at[after] - at[before], 1e-9), 0, 1)
        ways = {"linear": share, "smooth": share**2 * (3 - 2 * share), "step": np.floor(share)}
        names = np.array([key.ease for key in self.key])[before]
        eased = np.select([names == name for name in ways], list(ways.values()))[:, None]
        return values[before] + eased * (values[after] - values[before])

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
        flat = turned + np.array(self.centre_mm) + self.keyed(time)[:, :2]
        return 1e-3 * np.column_stack([flat, np.full(len(flat), self.above_mm)])

    def pressure(self, time: Array, rate: float) -> Array:
        """Pressure of frames at times in s, at `rate` in Hz: shape (frame,), in Pa; 0 outside of its start and end."""
        sounds = (time >= self.start_s - 1e-9) & (time < self.stop_s - 1e-9)
        modulation = 1.0 if self.am is None else self.am.factor(time - self.start_s)
        if self.receptors is not None:
            modulation = modulation * self.receptors.factor(time - self.start_s)
        recorded = 1.0 if self.signal is None else self.signal.factor(time - self.start_s, rate)
        return np.asarray(self.pressure_pa * sounds * modulation * recorded * self.keyed(time)[:, 2], float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A named number of a pattern's file, which stands there as "$NAME" in place of a number."""

    default: float
    min: float = -np.inf
    max: float = np.inf

    def chosen(self, name: str, value: float | None) -> float:
        """The value, the default if None. Raises InputError if it is out of range."""
        number = self.default if value is None else value
        if not self.min <= number <= self.max:
            raise InputError(f"{name}: expected {self.min:g} to {self.max:g}, got {number:g}")
        return number


@dataclass(frozen=True, slots=True, kw_only=True)
class Pattern(Checked):
    """Spots that are drawn at once."""

    spot: tuple[Spot, ...] = (Spot(),)
    name: str = setting("", "Name of the pattern.")
    rate_hz: float = setting(4000.0, "Frames per second.", unit="Hz", limits=(1, FASTEST))
    duration_s: float | None = setting(None, "Length of one pass; none: a loop.", unit="s", limits=(0, 1e5), above=True)
    height_mm: float = setting(
        1e3 * HEIGHT, "Palm above the array.", unit="mm", limits=(1e3 * HEIGHTS[0], 1e3 * HEIGHTS[1])
    )

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        for number, spot in enumerate(self.spot, 1):
            for name, asked in (
                ("draw_hz", spot.rate()),
                ("am.frequency_hz", spot.am.frequency_hz if spot.am else 0),
                ("receptors.pacinian_hz", spot.receptors.pacinian_hz if spot.receptors else 0),
            ):
                if asked > self.rate_hz / 2:
                    raise InputError(
                        f"spot {number}: {name}: expected at most {self.rate_hz / 2:g} Hz, half of rate_hz, got "
                        f"{asked:g} Hz"
                    )

    def seconds(self, duration: float | None = None) -> float:
        """`duration` in s, that of one pass if None. Raises InputError for a loop without one."""
        seconds = self.duration_s if duration is None else duration
        if seconds is None:
            raise InputError(
                "duration: expected a time, since the pattern is a loop; give duration_s in the file, or "
                "midair draw --duration"
            )
        return seconds

    def foci(self, duration: float | None = None) -> Foci:
        """The foci of every frame for `duration` in s, one pass if None. Raises InputError for a loop without one."""
        seconds = self.seconds(duration)
        frames = max(round(seconds * self.rate_hz), 1)
        check_memory_for(100.0 * frames * len(self.spot), f"{seconds:g} s of the pattern", "make it shorter")
        time = np.arange(frames) / self.rate_hz
        position = np.stack([spot.places(time) for spot in self.spot], axis=1)
        return Foci(
            position=position + np.array([0, 0, 1e-3 * self.height_mm]),
            pressure=np.stack([spot.pressure(time, self.rate_hz) for spot in self.spot], axis=1),
            rate=self.rate_hz,
            height=1e-3 * self.height_mm,
        )

    @classmethod
    def from_plain(cls, values: Mapping[str, Any], chosen: Mapping[str, float] | None = None) -> "Pattern":
        """Build a pattern from the dicts of its TOML file, with `chosen` values of its parameters.

        Raises InputError that names the invalid key.
        """
        given, tables = dict(values), values.get("parameters", {})
        given.pop("parameters", None)
        if not isinstance(tables, Mapping) or not all(isinstance(each, Mapping) for each in tables.values()):
            raise InputError(f"parameters: expected tables such as size = {{ default = 12.0 }}, got {tables!r}")
        check_parameters(chosen or {}, tables)
        known: dict[str, Parameter] = {name: from_plain(Parameter, tables[name], where=f"{name}.") for name in tables}
        values = _filled(given, {f"${name}": one.chosen(name, (chosen or {}).get(name)) for name, one in known.items()})
        tables = values.get("spot", [])
        if not (isinstance(tables, list) and tables and all(isinstance(table, Mapping) for table in tables)):
            raise InputError("spot: expected one table [[spot]] or more, got none")
        check_count(len(tables), MOST_SPOTS, "spot")
        check_count(sum(len(keys) for one in tables if isinstance(keys := one.get("key"), list)), MOST_KEYS, "key")
        spots: list[Spot] = []
        for number, table in enumerate(tables, 1):
            try:
                spots.append(from_plain(Spot, dict(table) | {"shape": _shape(table.get("shape", "points"))}))
            except InputError as wrong:
                raise InputError(f"spot {number}: {wrong}") from None
        return from_plain(cls, dict(values) | {"spot": tuple(spots)})


def _filled(value: Any, numbers: Mapping[str, float]) -> Any:
    """The same dicts and lists with numbers in place of the names of parameters."""
    if isinstance(value, Mapping):
        return {name: _filled(each, numbers) for name, each in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list):
        return [_filled(each, numbers) for each in value]  # pyright: ignore[reportUnknownVariableType]
    return numbers.get(value, value) if isinstance(value, str) else value


def _shape(table: Any) -> Shape:
    given: dict[str, Any] = dict(table) if isinstance(table, Mapping) else {"name": table}
    name = given.pop("name", None)
    if not isinstance(name, str) or name not in SHAPES:
        raise InputError(f"shape: expected one of {', '.join(SHAPES)} as name, got {name!r}")
    return from_plain(SHAPES[name], given, where="shape.")


PATTERN_ENDINGS, MOST_SPOTS = (".toml", ".adaptics"), 32
"""Endings of patterns; number of spots above which one is refused: each takes as long as the others to draw."""

PALETTE: Mapping[str, dict[str, Any]] = read_toml(Path(__file__).with_name("palette.toml"), "patterns")
"""Patterns to start from, by name, as the dicts of their files."""


def load_pattern(
    path: str | os.PathLike[str], chosen: Mapping[str, float] | None = None, *, pressure: float = 50.0
) -> Pattern | AdapticsPattern:
    """Read a pattern from a TOML file, or from one of the AdapTics Designer.

    `chosen` are values of its parameters, and `pressure` is that of intensity 1 of the AdapTics Designer in Pa. Raises
    MissingFileError, or BrokenFileError if a key or a value is invalid.
    """
    if os.fspath(path).lower().endswith(".adaptics"):
        return load_adaptics(path, chosen or {}, pressure=pressure)
    content = read_toml(path, "a pattern in TOML")
    for spot in spots if isinstance(spots := content.get("spot"), list) else []:
        if isinstance(spot, dict) and isinstance(signal := spot.get("signal"), dict) and "file" in signal:
            # A path is relative to the pattern.
            signal["file"] = os.path.join(os.path.dirname(os.fspath(path)), str(signal["file"]))
    try:
        return Pattern.from_plain(content, chosen)
    except InputError as wrong:
        raise BrokenFileError(f"{path}: {wrong}") from wrong


def draw_file(
    foci: Foci,
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    array: TransducerArray,
    *,
    chosen: Mapping[str, float] | None = None,
    medium: Medium | None = None,
    progress: Progress | None = None,
) -> float:
    """Write the drive of foci, and the largest part of the reachable pressure that they ask for; see `draw_parts`.

    The text of the pattern's file `source` and the `chosen` values of its parameters become part of the provenance.
    Raises the errors of `check_reach`, before the file is begun.
    """
    acoustics = Acoustics(medium=medium or Medium.at())
    used, settings = check_reach(foci, array, acoustics), drawn_settings(foci, acoustics)
    text = {"pattern": read_text(source, "a pattern")} | {
        f"parameter {name}": each for name, each in (chosen or {}).items()
    }
    life = settings.noted(Provenance(source=os.path.basename(source)).then("draw", text))
    method = "closed form" if foci.pressure.shape[1] == 1 else "gs-pat, lm"
    solved = life.then("solve", {"method": method, "array_calibration": array.calibration_id})
    parts = draw_parts(foci, array, acoustics=acoustics, provenance=solved, progress=progress)
    save_solutions(parts, target, frames=foci.frames, target=wanted_amplitude(foci, array, settings, life))
    return used
