"""Interpolate from cells to control points, and compensate their overlap: a cell measures its neighbours too."""

from dataclasses import replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import ControlGrid, PressureFrames, SensorGrid
from midair.physics import SensorModel, cell_weights
from midair.streaming import each_frame


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

    `cells`, shape (frame, channel), has any unit, and the result the same; `offset`, shape (frame, 2), is the
    displacement (x, y) in m.
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


def coupling(sensor: SensorModel, grid: ControlGrid) -> Array:
    """Reading of each cell for pressure interpolated from each cell, shape (cell, cell).

    Interpolation spreads a cell's pressure over a triangle of one pitch, and the sensor averages over its aperture: M =
    w T, with T the interpolation and w the cells' weights (`physics.cell_weights`).
    """
    # Like the interpolation, the weights must put the sensor at the grid's centre, wherever that is.
    weights = cell_weights(sensor, replace(grid, centre=(0.0, 0.0)), between="lines")
    return weights @ interpolation_matrix(sensor.grid, grid)


def decouple(
    pressure: PressureFrames,
    *,
    grid: ControlGrid | None = None,
    sensor: SensorModel | None = None,
    worst: float = 100.0,
) -> PressureFrames:
    """Pressure whose interpolation to the grid (by default the paper's) gives each cell its original reading.

    x' = M^-1 x, exact for interpolated pressure and approximate for interpolated amplitude. Apply it before a mapping,
    which handles the negative values that it adds. `sensor` gives aperture and spread; the usual ones if None. Raises
    InputError if the condition number of M, which amplifies noise, is higher than `worst`.
    """
    grid, sensor = grid or ControlGrid(), sensor or SensorModel.usual(pressure.sensor)
    matrix = coupling(sensor, grid)
    condition = float(np.linalg.cond(matrix))
    if not condition <= worst:
        raise InputError(
            f"decouple: expected control points that separate the cells, to a condition number of {worst:g}, got "
            f"{condition:.3g}; use a grid that covers the cells, or turn decouple off"
        )

    def undone(block: Array) -> Array:
        return np.asarray(np.linalg.solve(matrix, block.reshape(len(block), -1).T).T.reshape(block.shape), np.float64)

    return replace(
        pressure,
        pressure=each_frame(pressure.pressure, undone),
        provenance=pressure.provenance.then(
            "decouple", {"spread_m": sensor.spread, "aperture_m": sensor.aperture, "condition": condition}
        ),
    )
