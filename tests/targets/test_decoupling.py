import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.model import ControlGrid, Medium, PressureFrames, SensorGrid
from midair.physics import SensorModel, cell_weights, radiation_pressure
from midair.targets import coupling, decouple, interpolation_matrix, moved_interpolation, prepare


def frames(pressure):
    return PressureFrames(pressure=np.asarray(pressure, float).reshape(-1, 4, 4), rate=1000.0)


def test_a_cell_feels_most_of_its_own_and_some_of_its_neighbours_on_any_sensor():
    matrix = coupling(SensorModel(), ControlGrid())
    assert (np.argmax(matrix, axis=1) == np.arange(16)).all()
    assert 0.02 < matrix[5, 6] / matrix[5, 5] < 0.5
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9)
    few = PressureFrames(pressure=np.ones((2, 2, 3)), rate=1000.0, sensor=SensorGrid(rows=2, columns=3, pitch=9e-3))
    assert decouple(few).pressure.shape == (2, 2, 3)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_decoupled_pressure_gives_the_original_readings(seed):
    """Through prepare, sound amplitude, radiation pressure and the cells: exact when pressure is interpolated."""
    sensor, grid = SensorModel(), ControlGrid(centre=(0.01, -0.02))
    wanted = np.random.default_rng(seed).uniform(5, 6, (3, 16))
    target = prepare(decouple(frames(wanted), grid=grid), grid=grid, interpolate="pressure")
    pressed = radiation_pressure(target.amplitude, Medium())
    read = pressed @ cell_weights(sensor, grid, centre=grid.centre, between="lines").T
    np.testing.assert_allclose(read, wanted, rtol=1e-9)


SENSOR, GRID = SensorGrid(), ControlGrid()


def test_a_pattern_that_stays_is_the_constant_matrix_and_one_point_to_the_right_one_column():
    cells = np.random.default_rng(0).random((5, 16))
    still, moved = (
        moved_interpolation(cells, SENSOR, GRID, np.tile([x, 0.0], (5, 1))).reshape(5, 16, 16) for x in (0, GRID.pitch)
    )
    np.testing.assert_allclose(still.reshape(5, 256), cells @ interpolation_matrix(SENSOR, GRID).T, atol=1e-12)
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
