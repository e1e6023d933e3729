import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.errors import InputError
from midair.model import ControlGrid, Medium, PressureFrames, SensorGrid
from midair.physics import SensorModel, cell_weights, radiation_pressure
from midair.targets import coupling, decouple, prepare


def frames(pressure):
    return PressureFrames(pressure=np.asarray(pressure, float).reshape(-1, 4, 4), rate=1000.0)


def test_a_cell_feels_most_of_its_own_and_some_of_its_neighbours():
    matrix = coupling(SensorModel(), ControlGrid())
    assert (np.argmax(matrix, axis=1) == np.arange(16)).all()
    assert 0.02 < matrix[5, 6] / matrix[5, 5] < 0.5
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9)


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


def test_the_step_is_written_down():
    step = decouple(frames(np.ones(16))).provenance.steps[-1]
    assert step.stage == "decouple"
    assert step.settings["spread_m"] == SensorModel().spread


def test_points_that_do_not_tell_cells_apart_are_refused():
    with pytest.raises(InputError, match="decouple: expected control points that separate the cells"):
        decouple(frames(np.ones(16)), grid=ControlGrid(rows=2, columns=2, pitch=11e-3))


def test_any_sensor():
    few = PressureFrames(pressure=np.ones((2, 2, 3)), rate=1000.0, sensor=SensorGrid(rows=2, columns=3, pitch=9e-3))
    assert decouple(few).pressure.shape == (2, 2, 3)
