"""Peak position of a field."""

import numpy as np

from midair.array_types import Array, Complex
from midair.model import ControlGrid, SensorGrid

Field = Complex | Array


def peak_position(values: Array, grid: ControlGrid | SensorGrid) -> tuple[float, float]:
    """(x, y) of the largest value of a map (row, column) or (point,), relative to the centre of its grid, in m."""
    row, column = np.unravel_index(int(np.argmax(values)), grid.shape)
    return float(grid.x[column]), float(grid.y[row])
