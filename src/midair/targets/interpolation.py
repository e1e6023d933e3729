"""Linear interpolation from the cells of a sensor to the control points (paper, 4.1)."""

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, SensorGrid

Array = NDArray[np.float64]


def interpolation_matrix(sensor: SensorGrid, grid: ControlGrid) -> Array:
    """Weight of each channel at each control point, shape (point, channel): a triangle of one pitch around each cell.

    Linear interpolation over rows and columns of the sensor's values with a ring of zeros around them is a constant
    matrix; points outside the ring have weight 0. The centres of sensor and grid coincide for any `grid.centre`: moving
    the grid moves the pattern.
    """
    rows, columns = _tents(grid.y, sensor.y, sensor.pitch), _tents(grid.x, sensor.x, sensor.pitch)
    return np.einsum("ai,bj->abij", rows, columns).reshape(grid.count, sensor.count)


def moved_interpolation(cells: Array, sensor: SensorGrid, grid: ControlGrid, offset: Array) -> Array:
    """Interpolate with the pattern displaced in each frame, shape (frame, point); parts outside the grid are lost.

    Parameters
    ----------
    cells : ndarray, shape (frame, channel)
        In any unit, which the result has, too.
    offset : ndarray, shape (frame, 2)
        (x, y) of the pattern's displacement, in m.
    """
    rows = _tents(grid.y - offset[:, 1:], sensor.y, sensor.pitch)
    columns = _tents(grid.x - offset[:, :1], sensor.x, sensor.pitch)
    maps = np.asarray(cells, float).reshape(-1, *sensor.shape)
    moved = rows @ maps @ columns.transpose(0, 2, 1)
    return moved.reshape(len(maps), grid.count)


def _tents(points: Array, cells: Array, pitch: float) -> Array:
    """max(0, 1 - |distance| / pitch), shape (..., point, cell); values at rounding level are 0."""
    weight = 1 - np.abs(points[..., None] - cells) / pitch
    return np.where(weight > 1e-12, weight, 0.0)
