"""Radiation pressure outside the square of control points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model import Acoustics, ControlGrid, Drive
from midair.physics import propagate, radiation_pressure


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
