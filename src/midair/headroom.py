"""How hard an array can press, how hard a drive asks it to, and what comes of that; all by the model, in Pa.

An array of equally loud transducers adds up to one strong focus or to a weaker pressure all over the palm. Up to some
level what is asked for comes; beyond it more is asked for and hardly more comes.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from midair.evaluate import in_band
from midair.lazy_frames import blocks, read_frames
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, SensorGrid, Solution, TransducerArray
from midair.physics import focus_amplitude, radiation_pressure, sound_amplitude, transfer_matrix
from midair.settings import Settings
from midair.solvers import solve
from midair.targets import interpolation_matrix, piece_of

Array = NDArray[np.float64]

LINEAR = 0.9
"""Part of what is asked for that comes at the end of the linear range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Headroom:
    """What can be had of an array at a height.

    Attributes
    ----------
    height : float
        In m.
    focus : float
        Pressure in the middle of one focus of the whole array, in Pa.
    even : float
        Pressure on all cells at once at the end of the linear range, in Pa.
    most : float
        Pressure on all cells at once that more asking does not exceed, in Pa.
    """

    height: float
    focus: float
    even: float
    most: float

    @property
    def swing(self) -> float:
        """Amplitude of vibration on all cells at once, in Pa: sound only pushes, so half of the pressure is its rest.

        With half-wave rectification as well, which leaves half of the wave.
        """
        return self.even / 2

    def __str__(self) -> str:
        return (
            f"{_pa(self.focus)} in one focus, {_pa(self.even)} on all cells at once, of which {_pa(self.swing)} "
            f"swing either way; {1e3 * self.height:.3g} mm above the array"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureLevel:
    """What a drive was asked for and what comes of it, without its lead.

    Attributes
    ----------
    strength : float
        Peak of the sound that is asked for, over that of one focus of the whole array.
    asked : float
        Highest pressure at a control point, in Pa.
    steady : float
        Its mean over time at the same point, in Pa: push without vibration.
    vibration : float
        Rms of the vibration in the band at the same point, in Pa.
    comes : float
        Part of the asked pressure that comes in the loudest frames.
    linear : float
        Highest pressure at a control point up to which the loudest pattern is in the linear range, in Pa.
    headroom : Headroom
        What can be had at all.
    """

    strength: float
    asked: float
    steady: float
    vibration: float
    comes: float
    linear: float
    headroom: Headroom

    @property
    def too_loud(self) -> bool:
        """Whether it is above the linear range: more is asked for than comes."""
        return self.asked > self.linear and self.comes < LINEAR

    def advice(self) -> str:
        """What to do where it is asked for too much; empty where it is not."""
        if not self.too_loud:
            return ""
        fits = self.linear / self.asked
        return (
            f"level: {_pa(self.asked)} are asked for and {100 * self.comes:.0f} % of them come; this pattern comes in "
            f"full up to about {_pa(self.linear)}: take --strength {self.strength * np.sqrt(fits):.2g}, or a --gain "
            f"{fits:.2g} times as large"
        )

    def rows(self) -> list[tuple[str, str]]:
        """In words."""
        return [
            ("can be had", str(self.headroom)),
            (
                "asked",
                f"{_pa(self.asked)} at most, strength {self.strength:.3f}; at that point {_pa(self.steady)} steady "
                f"and {_pa(self.vibration)} rms of vibration",
            ),
            (
                "comes",
                f"{100 * self.comes:.0f} % of it in the loudest frames, by the model; in full up to about "
                f"{_pa(self.linear)}",
            ),
        ]

    def plain(self) -> dict[str, object]:
        """For JSON: pressures in Pa."""
        own = {f"{name}_pa": getattr(self, name) for name in ("asked", "steady", "vibration", "linear")}
        head = {f"{name}_pa": value for name, value in asdict(self.headroom).items() if name != "height"}
        return {
            "strength": self.strength,
            **own,
            "comes": self.comes,
            "too_loud": self.too_loud,
            "can_be_had": {"height_m": self.headroom.height, **head, "swing_pa": self.headroom.swing},
        }


def headroom(
    array: TransducerArray,
    grid: ControlGrid,
    acoustics: Acoustics | None = None,
    *,
    sensor: SensorGrid | None = None,
) -> Headroom:
    """What an array can press at the height of a grid; the second time for the same it is known.

    Parameters
    ----------
    array : TransducerArray
        What plays, at equal and full amplitudes.
    grid : ControlGrid
        The control points.
    acoustics : Acoustics, optional
        The air and the directivity; the paper's if None.
    sensor : SensorGrid, optional
        Whose cells are pressed all at once; the paper's 4 x 4 if None.
    """
    key = array.position.tobytes() + array.normal.tobytes()
    return _headroom(_Keyed(array=array, key=(key, array.pressure, array.frequency)), grid, acoustics, sensor)


def level_of(
    solution: Solution, target: AmplitudeFrames, *, band: tuple[float, float] = (20.0, 470.0)
) -> PressureLevel:
    """How hard a drive was asked to press, and what comes of it by the model.

    Parameters
    ----------
    solution : Solution
        What was found.
    target : AmplitudeFrames
        What it was found for.
    band : tuple of float
        In which vibration counts, in Hz.
    """
    drive = solution.drive
    medium = drive.acoustics.medium
    piece = piece_of(target.provenance, target.frames, target.rate)
    loudest, point, sums = _loudest(target, piece)
    wave = _at_point(target, piece, point)
    pressure = radiation_pressure(wave, medium)
    vibration = in_band(pressure[:, None], target.rate, (band[0], min(band[1], target.rate / 2)))
    pattern = read_frames(target.amplitude, loudest, loudest + 1)[0]
    room = headroom(drive.array, target.grid, drive.acoustics)
    asked = float(radiation_pressure(np.array(sums.max()), medium))
    linear, _ = linear_range(drive.array, target.grid, pattern**2, drive.acoustics)
    return PressureLevel(
        strength=float(np.sqrt(asked / room.focus)),
        asked=asked,
        steady=float(pressure.mean()),
        vibration=float(np.sqrt((vibration**2).mean())),
        comes=_comes(drive, target, _loud_frames(target, piece)),
        linear=linear,
        headroom=room,
    )


def band_of(target: AmplitudeFrames) -> tuple[float, float]:
    """The band of the recording that a target was made of; 20 to 470 Hz where nothing tells."""
    known = Settings.of(target.provenance)
    return (20.0, 470.0) if known is None else known.calibration.band


def linear_range(
    array: TransducerArray, grid: ControlGrid, pattern: Array, acoustics: Acoustics | None = None
) -> tuple[float, float]:
    """Highest pressure of a pattern up to which it comes, and the highest that comes at all, in Pa.

    Parameters
    ----------
    array, grid, acoustics
        As in `headroom`.
    pattern : ndarray, shape (point,)
        Pressure at the points over any unit.
    """
    acoustics, top = acoustics or Acoustics(), float(pattern.max())
    if not top > 0:
        return 0.0, 0.0
    chosen, grid = thinned(grid)
    pattern = pattern[chosen]
    focus = radiation_pressure(np.array(focus_amplitude(grid, array, acoustics=acoustics)), acoustics.medium)
    asked = float(focus) * np.geomspace(2e-3, 1.0, 9)
    wanted = asked[:, None] * pattern / top
    frames = AmplitudeFrames(amplitude=sound_amplitude(wanted, acoustics.medium), rate=1000.0, grid=grid)
    drive = solve(frames, array, acoustics=acoustics, method="fast", iterations=(30, 30)).drive
    G = transfer_matrix(grid, array, acoustics=acoustics)
    pressed = radiation_pressure(drive.q @ G.T, acoustics.medium)
    part = (pressed * wanted).sum(axis=1) / (wanted**2).sum(axis=1)
    lacks = np.flatnonzero(part < LINEAR * part[0])
    if not len(lacks):
        return float(asked[-1]), float((part * asked).max())
    first = int(lacks[0])
    # On a straight line between the last level that comes and the first that does not, over its logarithm.
    low, high = part[first - 1] / part[0], part[first] / part[0]
    share = (low - LINEAR) / (low - high)
    return float(asked[first - 1] * (asked[first] / asked[first - 1]) ** share), float((part * asked).max())


def thinned(grid: ControlGrid, *, side: int = 16) -> tuple[NDArray[np.int64], ControlGrid]:
    """Which points of a grid are looked at, so that a fine one costs no more than the paper's; and those as a grid."""
    step = max(1, -(-max(grid.shape) // side))
    rows, columns = np.arange(0, grid.rows, step), np.arange(0, grid.columns, step)
    middle = (float(grid.x[columns].mean()) + grid.centre[0], float(grid.y[rows].mean()) + grid.centre[1])
    part = replace(grid, rows=len(rows), columns=len(columns), pitch=step * grid.pitch, centre=middle)
    return (rows[:, None] * grid.columns + columns).ravel(), part if step > 1 else grid


def _pa(value: float) -> str:
    """In two digits, as exact as a model is."""
    return f"{float(f'{value:.2g}'):g} Pa"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Keyed:
    """An array that is the same as another of the same numbers, for a cache."""

    array: TransducerArray
    key: tuple[bytes, float, float]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Keyed) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@lru_cache(maxsize=32)
def _headroom(keyed: _Keyed, grid: ControlGrid, acoustics: Acoustics | None, sensor: SensorGrid | None) -> Headroom:
    acoustics = acoustics or Acoustics()
    focus = radiation_pressure(np.array(focus_amplitude(grid, keyed.array, acoustics=acoustics)), acoustics.medium)
    even = interpolation_matrix(sensor or SensorGrid(), grid).sum(axis=1)
    linear, most = linear_range(keyed.array, grid, even, acoustics)
    return Headroom(height=grid.height, focus=float(focus), even=linear, most=most)


def _loudest(target: AmplitudeFrames, piece: slice) -> tuple[int, int, Array]:
    """The frame that asks for most in all, the point with the highest amplitude, and the highest of each point."""
    most, frame, top = -1.0, piece.start, np.zeros(target.grid.count)
    for first, block in _stretches(target, piece):
        power = (block**2).sum(axis=1)
        if power.max() > most:
            most, frame = float(power.max()), first + int(power.argmax())
        top = np.maximum(top, block.max(axis=0))
    return frame, int(top.argmax()), top


def _loud_frames(target: AmplitudeFrames, piece: slice, *, count: int = 16) -> list[int]:
    """Frames that ask for most, no more than `count`."""
    power = np.concatenate([(block**2).sum(axis=1) for _, block in _stretches(target, piece)])
    return [piece.start + int(frame) for frame in np.argsort(power)[::-1][:count]]


def _at_point(target: AmplitudeFrames, piece: slice, point: int) -> Array:
    # Copies: a view would keep the whole block that it is of.
    return np.concatenate([block[:, point].copy() for _, block in _stretches(target, piece)])


def _stretches(target: AmplitudeFrames, piece: slice) -> Iterator[tuple[int, Array]]:
    first = piece.start
    for block in blocks(target.amplitude[piece.start : piece.stop]):
        yield first, block
        first += len(block)


def _comes(drive: Drive, target: AmplitudeFrames, frames: list[int]) -> float:
    """Best factor from asked to pressed over some frames, as if every frame lasted for ever."""
    medium = drive.acoustics.medium
    phase, level, wanted = (
        np.concatenate([read_frames(each, one, one + 1) for one in frames])
        for each in (drive.phase, drive.level, target.amplitude)
    )
    part = Drive(phase=phase, level=level, rate=drive.rate, array=drive.array, acoustics=drive.acoustics)
    chosen, grid = thinned(target.grid)
    G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics)
    asked, pressed = radiation_pressure(wanted[:, chosen], medium), radiation_pressure(part.q @ G.T, medium)
    power = float((asked**2).sum())
    return float((asked * pressed).sum() / power) if power > 0 else 1.0
