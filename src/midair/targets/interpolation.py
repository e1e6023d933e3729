"""Linear interpolation from the cells of a sensor to the control points (paper, 4.1)."""

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, SensorGrid

Array = NDArray[np.float64]


def interpolation_matrix(sensor: SensorGrid, grid: ControlGrid) -> Array:
    """Weight of each channel at each control point, shape (point, channel): a tent of one pitch around each cell.

    Linear interpolation over rows and columns of the sensor's values with a ring of zeros around them is a
    constant matrix; points outside the ring have no weights. The centres of sensor and grid coincide, whatever
    `grid.centre` says: moving the grid moves what is played.
    """
    rows, columns = _tents(grid.y, sensor.y, sensor.pitch), _tents(grid.x, sensor.x, sensor.pitch)
    return np.einsum("ai,bj->abij", rows, columns).reshape(grid.count, sensor.count)


def moved_interpolation(cells: Array, sensor: SensorGrid, grid: ControlGrid, offset: Array) -> Array:
    """The same, with the pattern moved frame by frame: what leaves the grid is lost.

    Parameters
    ----------
    cells : ndarray, shape (frame, channel)
        Any unit.
    sensor, grid
        As in `interpolation_matrix`.
    offset : ndarray, shape (frame, 2)
        (x, y) by which the pattern is moved, in m.

    Returns
    -------
    ndarray, shape (frame, point)
        Same unit.
    """
    rows = _tents(grid.y - offset[:, 1:], sensor.y, sensor.pitch)
    columns = _tents(grid.x - offset[:, :1], sensor.x, sensor.pitch)
    maps = np.asarray(cells, float).reshape(-1, *sensor.shape)
    moved = rows @ maps @ columns.transpose(0, 2, 1)
    return moved.reshape(len(maps), grid.count)


def _tents(points: Array, cells: Array, pitch: float) -> Array:
    """max(0, 1 - |distance| / pitch), shape (..., point, cell); below rounding counts as 0."""
    weight = 1 - np.abs(points[..., None] - cells) / pitch
    return np.where(weight > 1e-12, weight, 0.0)
