import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.model import ControlGrid, SensorGrid
from midair.targets import interpolation_matrix, moved_interpolation

SENSOR, GRID = SensorGrid(), ControlGrid()


def test_a_pattern_that_stays_is_the_constant_matrix():
    cells = np.random.default_rng(0).random((5, 16))
    still = moved_interpolation(cells, SENSOR, GRID, np.zeros((5, 2)))
    np.testing.assert_allclose(still, cells @ interpolation_matrix(SENSOR, GRID).T, atol=1e-12)


def test_one_point_to_the_right_is_one_column_to_the_right():
    cells = np.random.default_rng(1).random((3, 16))
    still = (cells @ interpolation_matrix(SENSOR, GRID).T).reshape(3, 16, 16)
    moved = moved_interpolation(cells, SENSOR, GRID, np.tile([GRID.pitch, 0.0], (3, 1))).reshape(3, 16, 16)
    np.testing.assert_allclose(moved[:, :, 1:], still[:, :, :-1], atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(-5e-3, 5e-3), st.floats(-5e-3, 5e-3), st.integers(0, 15))
def test_the_middle_of_a_moved_cell_lies_where_it_was_moved_to(x, y, channel):
    """The centroid of one cell's tent on a grid wide enough to hold it."""
    wide = ControlGrid(rows=81, columns=81, pitch=1e-3)
    cells = np.zeros((1, 16))
    cells[0, channel] = 1
    tent = moved_interpolation(cells, SENSOR, wide, np.array([[x, y]])).reshape(81, 81)
    place = SENSOR.channel_position(channel)
    np.testing.assert_allclose((tent.sum(axis=0) @ wide.x) / tent.sum(), place[0] + x, atol=1e-4)
    np.testing.assert_allclose((tent.sum(axis=1) @ wide.y) / tent.sum(), place[1] + y, atol=1e-4)
