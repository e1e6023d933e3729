"""How the pressure that a drive requests compares with the pressure that comes (model, in Pa).

Up to some level the produced pressure follows the requested one; beyond it, it saturates.
"""

import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.evaluate import Felt, felt, in_band
from midair.files import load_prediction, load_solution, load_target, store_prediction
from midair.model import BAND, AmplitudeFrames, ControlGrid, Drive, Palm, Solution, frames_without_lead
from midair.physics import SKINS, SkinMotion, radiation_pressure, transfer_matrix
from midair.settings import Settings
from midair.streaming import blocks, read_frames
from midair.version import __version__

LINEAR = 0.9
"""Ratio of produced to requested pressure at the end of the linear range."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureLevel:
    """Pressure that a drive requests, and the pressure that the model predicts for it, without its lead."""

    strength: float
    """Requested peak sound amplitude relative to a single focus of the whole array."""
    asked: float
    """Highest requested pressure at a control point, in Pa."""
    steady: float
    """Mean pressure over time at the same point, in Pa."""
    vibration: float
    """Rms of the vibration in the band at the same point, in Pa."""
    comes: float
    """Ratio of predicted to requested pressure in the loudest frames."""
    find_peak: Callable[[], float]
    """Computes `peak`."""

    @cached_property
    def peak(self) -> float:
        """Highest predicted pressure at any point of a palm of 85 mm, in Pa; computed on first use."""
        return self.find_peak()

    @property
    def too_loud(self) -> bool:
        """True above the linear range, where the predicted pressure falls short of the requested one."""
        return self.comes < LINEAR

    def advice(self) -> str:
        """Suggested strength or gain if the drive requests too much; otherwise empty."""
        if not self.too_loud:
            return ""
        # About what the array reaches, it also reaches when no more is requested.
        return (
            f"too strong for the array, which reaches {100 * self.comes:.0f} % of the peak of {_pa(self.asked)}: use "
            f"--strength {self.strength * np.sqrt(self.comes):.2g}, or a --gain {self.comes:.2g} times as large"
        )

    def row(self) -> tuple[str, str]:
        """Label and text of the most important row of a printed table."""
        parts = f"{_pa(self.steady)} steady push, {_pa(self.vibration)} rms vibration"
        return "pressure", f"peak {_pa(self.asked)}: {parts}"

    def rows(self) -> list[tuple[str, str]]:
        """Label and text of each row, the most important first."""
        return [
            self.row(),
            ("reached", f"{100 * self.comes:.0f} % of the peak, by the model"),
            ("loudest point", f"{_pa(self.peak)} on the palm"),
            ("strength", f"{self.strength:.3f} of the sound of a single focus"),
        ]

    def plain(self) -> dict[str, object]:
        """Dictionary for JSON, pressures in Pa."""
        own = {f"{name}_pa": getattr(self, name) for name in ("asked", "steady", "vibration", "peak")}
        return {"strength": self.strength, **own, "comes": self.comes, "too_loud": self.too_loud}


def level_of(solution: Solution, target: AmplitudeFrames, *, band: tuple[float, float] = BAND) -> PressureLevel:
    """Requested and predicted pressure of a solution for its target; vibration is measured within `band`, in Hz."""
    drive = solution.drive
    medium = drive.acoustics.medium
    piece = frames_without_lead(target.provenance, target.frames, target.rate)
    point, sums = _loudest(target, piece)
    wave = _at_point(target, piece, point)
    pressure = radiation_pressure(wave, medium)
    vibration = in_band(pressure[:, None], target.rate, (band[0], min(band[1], target.rate / 2)))
    G = transfer_matrix(target.grid, drive.array, acoustics=drive.acoustics)
    asked = float(radiation_pressure(np.array(sums.max()), medium))
    powerful = _highest(target, piece, lambda block: (block**2).sum(axis=1), count=16)
    return PressureLevel(
        strength=float(np.sqrt(asked / radiation_pressure(np.abs(G).sum(axis=1).max(), medium))),
        asked=asked,
        steady=float(pressure.mean()),
        vibration=float(np.sqrt((vibration**2).mean())),
        comes=_pressure_ratio(drive, target, powerful, G),
        find_peak=partial(_peak_on_palm, drive, target),
    )


def band_of(target: AmplitudeFrames) -> tuple[float, float]:
    """Band of the recording that a target was made from, in Hz; 20 to 470 Hz where its provenance has none."""
    known = Settings.of(target.provenance)
    return BAND if known is None else known.calibration.band


def predicted(path: Path, solution: Solution, target: AmplitudeFrames) -> tuple[PressureLevel, Felt]:
    """Pressure of a drive that plays, and by how many people it is felt, by the model.

    From its file if this code stored them there, otherwise computed.
    """
    held = load_prediction(path)
    if not _stored_by_this_code(held):
        level = level_of(solution, target, band=band_of(target))
        return level, felt_of_drive(solution, target, level)
    levels = {name: float("-inf") if level is None else level for name, level in held["felt"].items()}
    level = PressureLevel(**held["level"], find_peak=partial(_peak_on_palm, solution.drive, target))
    return level, Felt(levels=MappingProxyType(levels), shares=tuple(held["shares"]))


def store_predicted(path: Path) -> None:
    """Store what `predicted` returns in the file of a drive that plays, with a digest of the code that computed it."""
    solution, target = load_solution(path, streamed=True), load_target(path, streamed=True)
    if target is None or not solution.plays.any():
        return
    level, feeling = predicted(path, solution, target)
    own = {name: getattr(level, name) for name in _STORED}
    plain = {"felt": feeling.plain()["over_threshold_db"], "shares": feeling.shares, "level": own}
    store_prediction(path, {"code": _digest_of_code(), **plain})


_STORED = ("strength", "asked", "steady", "vibration", "comes")
"""Values of a pressure level in a file."""


def _stored_by_this_code(held: Mapping[str, Any]) -> bool:
    """Whether values of a file have the digest, names and finite numbers that `store_predicted` writes."""
    own, levels, shares = held.get("level"), held.get("felt"), held.get("shares")
    if not (isinstance(own, dict) and isinstance(levels, dict) and isinstance(shares, list)):
        return False
    numbers = [*own.values(), *shares, *(each for each in levels.values() if each is not None)]
    known = held.get("code") == _digest_of_code() and own.keys() == set(_STORED) and levels.keys() == SKINS.keys()
    return known and all(isinstance(each, float) and np.isfinite(each) for each in numbers)


@cache
def _digest_of_code() -> str:
    """Digest of the code that holds the model of skin and the thresholds, and of the version of all other code."""
    sources = (sys.modules[each] for each in (__name__, felt.__module__, SkinMotion.__module__))
    code = b"".join(Path(str(each.__file__)).read_bytes() for each in sources)
    return hashlib.sha256(code + __version__.encode()).hexdigest()[:16]


def felt_of_drive(solution: Solution, target: AmplitudeFrames, level: PressureLevel) -> Felt:
    """By how many people the loudest two seconds of a drive are felt, if the array reaches what the model predicts."""
    from midair.patterns import wanted_pressure  # here: other commands need no patterns

    count, power = round(2 * target.rate), np.cumsum(power_of(target))
    first = int(np.argmax(power[count:] - power[:-count])) if len(power) > count else 0
    part = replace(target, amplitude=read_frames(target.amplitude, first, min(first + count, target.frames)))
    medium, grid = solution.drive.acoustics.medium, target.grid
    if target.provenance.last("draw"):
        # Cells would spread a focus; only a recording was made by cells.
        pressure, pitch = radiation_pressure(part.amplitude[:], medium).reshape(-1, grid.rows, grid.columns), grid.pitch
    else:
        cells = wanted_pressure(part, medium)
        pressure, pitch = cells.pressure, cells.sensor.pitch
    return felt(pressure, target.rate, pitch).at(20 * float(np.log10(max(level.comes, 1e-9))))


def power_of(target: AmplitudeFrames) -> Array:
    """Sum of the squared amplitudes of each frame."""
    return np.concatenate([(block**2).sum(axis=1) for block in blocks(target.amplitude)])


def thinned(grid: ControlGrid) -> NDArray[np.int64]:
    """Indices of every n-th point of a grid, so that a fine grid costs no more than the paper's."""
    step = max(1, -(-max(grid.shape) // 16))
    rows, columns = np.arange(0, grid.rows, step), np.arange(0, grid.columns, step)
    return (rows[:, None] * grid.columns + columns).ravel()


def _pa(value: float) -> str:
    """Pressure with two digits, the accuracy of the model."""
    return f"{float(f'{value:.2g}'):g} Pa"


def _loudest(target: AmplitudeFrames, piece: slice) -> tuple[int, Array]:
    """Point with the highest amplitude, and the maximum amplitude of each point."""
    top = np.zeros(target.grid.count)
    for block in _blocks(target, piece):
        top = np.maximum(top, block.max(axis=0))
    return int(top.argmax()), top


def _highest(target: AmplitudeFrames, piece: slice, of: Callable[[Array], Array], *, count: int) -> list[int]:
    """The `count` frames with the highest value of a function of a block of frames."""
    value = np.concatenate([of(block) for block in _blocks(target, piece)])
    return [piece.start + int(frame) for frame in np.argsort(value)[::-1][:count]]


def _at_point(target: AmplitudeFrames, piece: slice, point: int) -> Array:
    # Copies: a view would keep its whole block in memory.
    return np.concatenate([block[:, point].copy() for block in _blocks(target, piece)])


def _blocks(target: AmplitudeFrames, piece: slice) -> Iterator[Array]:
    return blocks(target.amplitude[piece.start : piece.stop])


def _pressure_ratio(drive: Drive, target: AmplitudeFrames, frames: list[int], G: Complex) -> float:
    """Least-squares ratio of produced to requested pressure over some frames in steady state."""
    medium, part, chosen = drive.acoustics.medium, _frames_of(drive, frames), thinned(target.grid)
    wanted = np.concatenate([read_frames(target.amplitude, one, one + 1) for one in frames])
    asked, pressed = radiation_pressure(wanted[:, chosen], medium), radiation_pressure(part.q @ G[chosen].T, medium)
    power = float((asked**2).sum())
    return float((asked * pressed).sum() / power) if power > 0 else 1.0


def _frames_of(drive: Drive, frames: list[int]) -> Drive:
    phase, level = (
        np.concatenate([read_frames(each, one, one + 1) for one in frames]) for each in (drive.phase, drive.level)
    )
    return Drive(phase=phase, level=level, rate=drive.rate, array=drive.array, acoustics=drive.acoustics)


def _peak_on_palm(drive: Drive, target: AmplitudeFrames) -> float:
    """Highest steady pressure in Pa on a palm around the control points: every 2.5 mm, then every .5 mm."""
    piece, grid, palm = frames_without_lead(target.provenance, target.frames, target.rate), target.grid, Palm.disc()
    drive = _frames_of(drive, _highest(target, piece, lambda block: block.max(axis=1), count=64))
    skin = palm.points(np.array([*grid.centre, grid.height]))

    def pressure(q: NDArray[np.complex128], points: Array) -> Array:
        G = transfer_matrix(points, drive.array, acoustics=drive.acoustics)
        return radiation_pressure(q @ G.T, drive.acoustics.medium)

    coarse = pressure(drive.q, skin)
    steps = np.linspace(-palm.pitch / 2, palm.pitch / 2, 6)
    around = np.stack([*np.meshgrid(steps, steps), np.zeros((6, 6))], axis=-1).reshape(-1, 3)
    # The highest points of the frame in which each is highest.
    points = np.argsort(coarse.max(axis=0))[-12:]
    return max(
        float(pressure(drive.q[frame], skin[point] + around).max())
        for point, frame in zip(points, coarse[:, points].argmax(axis=0), strict=True)
    )
