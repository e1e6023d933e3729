"""Error of a drive: by energy and by frame, in another air, and radiation pressure outside the control points."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.errors import MismatchError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, Medium
from midair.physics import propagate, radiation_pressure, relative_error
from midair.streaming import blocks

FAINT = 1e-2
"""Frames with less than this part of the strongest frame's power are faint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveError:
    """Error of a solved target."""

    energy: float
    """Root of the error's power over the target's power, all frames together."""
    mean: float
    """Mean over the frames that are not faint."""
    worst: float
    """Maximum over the frames that are not faint."""
    faint: int
    """Number of faint frames."""
    frames: int
    """Number of all frames that are not silent."""
    faint_mean: float
    """Mean error of the faint frames; 0 without any."""

    def __str__(self) -> str:
        said = f"{100 * self.energy:.1f} % by energy; mean {100 * self.mean:.1f} %, worst {100 * self.worst:.1f} %"
        if not self.faint:
            return said
        apart = f"{said}; {self.faint} of {self.frames} frames have less than a hundredth of the loudest's power"
        if self.faint_mean <= 1:
            return f"{apart}: mean {100 * self.faint_mean:.0f} %"
        return f"{apart}: there the output exceeds the target, --level auto reduces it"

    def plain(self) -> dict[str, object]:
        """Ratios for JSON."""
        return {
            "E_energy": self.energy,
            "E_mean": self.mean,
            "E_worst": self.worst,
            "faint_frames": self.faint,
            "E_faint": self.faint_mean,
        }


def error_by_energy(error: Array, power: Array) -> SolveError:
    """Summarise the errors E of frames, weighted with their targets' power in any unit; silent frames are ignored."""
    plays = power > 0
    error, power = error[plays], power[plays]
    if not len(error):
        return SolveError(energy=0.0, mean=0.0, worst=0.0, faint=0, frames=0, faint_mean=0.0)
    faint = power < FAINT * power.max()
    return SolveError(
        energy=float(np.sqrt((error**2 * power).sum() / power.sum())),
        mean=float(error[~faint].mean()),
        worst=float(error[~faint].max()),
        faint=int(faint.sum()),
        frames=len(error),
        faint_mean=float(error[faint].mean()) if faint.any() else 0.0,
    )


def error_at_temperature(drive: Drive, target: AmplitudeFrames, medium: Medium, *, frames: int | None = None) -> Array:
    """Compute the error E of a drive at the control points in another medium than its own.

    The target pressure stays the same; the required sound pressure depends on density and speed of sound. The result is
    ``|| |G q| - p || / || p ||`` of each computed frame, empty if all frames are silent.

    `target` is the one that the drive was solved for, `medium` the air in which it is played. Only `frames` evenly
    spaced frames among those that are not silent are computed; all if None. Raises MismatchError if target and drive
    differ in their number of frames.
    """
    if target.frames != drive.frames:
        raise MismatchError(f"target: expected {drive.frames} frames as in the drive, got {target.frames}")
    some = np.flatnonzero(np.concatenate([block.any(axis=1) for block in blocks(target.amplitude)]))
    if frames is not None and len(some) > frames:
        some = some[np.linspace(0, len(some) - 1, frames).round().astype(int)]
    if not len(some):
        return np.zeros(0)
    # Select the frames first: a copy of the whole drive would be as large as its file.
    part = replace(drive, phase=drive.phase[some], level=drive.level[some])
    field = propagate(part, target.grid, acoustics=replace(drive.acoustics, medium=medium))
    here, there = (float(radiation_pressure(np.ones(1), each)[0]) for each in (drive.acoustics.medium, medium))
    return relative_error(field, target.amplitude[some] * np.sqrt(here / there))


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """Radiation pressure outside the controlled square, relative to the highest target pressure inside."""

    peak: float
    """Highest pressure outside over all frames, relative to the highest target pressure of all frames."""
    typical: float
    """Median over the frames of the highest pressure outside, relative to the same."""
    place: tuple[float, float]
    """(x, y) of the highest pressure outside, from the centre of the grid, in m."""
    wanted: float
    """Highest target pressure in Pa."""


def surroundings(
    grid: ControlGrid, *, reach: float = 0.02, pitch: float = 2.5e-3
) -> tuple[ControlGrid, NDArray[np.bool_]]:
    """Create a larger grid around a control grid, with a mask (point,) of its points outside the square.

    The square ends half a pitch beyond the outermost control points. The larger grid has the margin `reach` around it
    and another `pitch`, both in m; 2.5 mm is a third of a wavelength at 40 kHz.
    """
    half_x, half_y = grid.columns * grid.pitch / 2, grid.rows * grid.pitch / 2
    rows, columns = (2 * int(np.ceil((half + reach) / pitch)) + 1 for half in (half_y, half_x))
    around = ControlGrid(rows=rows, columns=columns, pitch=pitch, height=grid.height, centre=grid.centre)
    x, y = np.meshgrid(around.x, around.y)
    # The tolerance keeps points on the edge inside despite rounding.
    outside = (np.abs(x) > half_x + 1e-9) | (np.abs(y) > half_y + 1e-9)
    return around, outside.ravel()


def leak(
    drive: Drive,
    amplitude: Array,
    grid: ControlGrid,
    *,
    acoustics: Acoustics | None = None,
    frames: int = 64,
    reach: float = 0.02,
) -> Leak:
    """Compute the pressure of a drive outside the square that it was solved for.

    `amplitude`, shape (frame, point), is the target at the points of `grid`, peak sound pressure in Pa; `acoustics` are
    those of the drive by default. `frames` evenly spaced frames are computed, besides the strongest one, with the
    margin `reach` around the square, in m.
    """
    acoustics = acoustics or drive.acoustics
    wanted = radiation_pressure(amplitude, acoustics.medium)
    chosen = np.unique(np.linspace(0, drive.frames - 1, min(frames, drive.frames)).astype(int))
    # Include the strongest frame, because its pressure is the reference.
    chosen = np.union1d(chosen, [int(np.argmax(wanted.max(axis=1)))])
    around, outside = surroundings(grid, reach=reach)
    part = Drive(phase=drive.phase[chosen], level=drive.level[chosen], rate=drive.rate, array=drive.array)
    field = propagate(part, around, acoustics=acoustics)
    pressure = np.where(outside, radiation_pressure(field, acoustics.medium), 0.0)
    top = float(wanted.max())
    hottest = pressure.max(axis=1)
    row, column = divmod(int(np.argmax(pressure[int(np.argmax(hottest))])), around.columns)
    over = hottest / top if top > 0 else np.zeros(len(hottest))
    return Leak(
        peak=float(over.max()),
        typical=float(np.median(over)),
        place=(float(around.x[column]), float(around.y[row])),
        wanted=top,
    )
