import numpy as np
import pytest

from midair.evaluate import peak_position
from midair.model import ControlGrid, SensorGrid


@pytest.mark.parametrize(
    "grid", [ControlGrid(rows=3, columns=5, pitch=0.01), SensorGrid(rows=3, columns=5, pitch=0.01)]
)
def test_peak_is_where_it_was_put(grid):
    values = np.zeros(grid.shape)
    values[2, 0] = 1
    assert peak_position(values, grid) == pytest.approx((-0.02, 0.01))
