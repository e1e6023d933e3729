import numpy as np
import pytest

from midair.errors import MidairError
from midair.model import ControlGrid, PressureFrames, SensorGrid
from midair.physics import SensorModel, cell_weights
from midair.solvers import Cells
from midair.solvers.terms.cells import CellTarget, cell_misfit

GRID = ControlGrid()


def test_by_hand():
    """Two cells, one of both points and one of the second: readings (1 + 4) / 2 and 4 against 2 and 4."""
    weights = np.array([[0.5, 0.5], [0.0, 1.0]])
    y, wanted = np.array([[1j, -2.0]]), np.array([[2.0, 4.0]])
    cost, slope = cell_misfit(np, y, weights.T, wanted, np.array([10.0]))
    assert cost == pytest.approx(10 * 0.5**2 / 2)
    np.testing.assert_allclose(slope, [[2 * 10 * 0.5 * 0.5 * 1j, 2 * 10 * 0.5 * 0.5 * -2]])


def test_the_slope_is_the_derivative(complex_slope):
    rng = np.random.default_rng(0)
    y, weights = rng.normal(size=(3, 5)) + 1j * rng.normal(size=(3, 5)), rng.uniform(0, 1, (5, 2))
    wanted, scale = rng.uniform(0, 3, (3, 2)), np.array([1.0, 0.2, 3.0])
    slope = cell_misfit(np, y, weights, wanted, scale)[1]
    expected = complex_slope(lambda z: cell_misfit(np, z, weights, wanted, scale)[0], y)
    np.testing.assert_allclose(slope, expected, atol=1e-6)


def test_the_target_is_the_reading_of_the_target_at_the_points():
    amplitude = np.random.default_rng(1).uniform(0, 1, (2, GRID.count))
    target = Cells().target(amplitude, GRID, 1.0)
    np.testing.assert_allclose(target.wanted, amplitude**2 @ cell_weights(SensorModel(), GRID, between="lines").T)
    heard = target.weights @ amplitude[0] ** 2
    assert target.error(amplitude)[0] == pytest.approx(
        np.linalg.norm(heard - target.wanted[0]) / np.linalg.norm(target.wanted[0])
    )


def test_the_cells_go_where_the_grid_goes():
    amplitude = np.ones((1, GRID.count))
    moved = Cells().target(amplitude, ControlGrid(centre=(0.03, 0.01)), 1.0)
    np.testing.assert_allclose(moved.weights, Cells().target(amplitude, GRID, 1.0).weights, atol=1e-12)


def test_a_given_pressure_is_in_pascal():
    """Amplitude 1 exerts 2 Pa: 6 Pa are an amplitude squared of 3."""
    pressure = PressureFrames(pressure=np.full((2, 4, 4), 6.0), rate=1000.0)
    target = Cells(pressure=pressure).target(np.ones((2, GRID.count)), GRID, 2.0)
    np.testing.assert_allclose(target.wanted, 3.0)


def test_a_pressure_of_other_frames_is_refused():
    pressure = PressureFrames(pressure=np.ones((3, 4, 4)), rate=1000.0)
    with pytest.raises(MidairError, match="pressure of the cells"):
        Cells(pressure=pressure).target(np.ones((2, GRID.count)), GRID, 1.0)


def test_other_sensors():
    sensor = SensorModel(grid=SensorGrid(rows=2, columns=3, pitch=15e-3))
    assert Cells(sensor=sensor).target(np.ones((1, GRID.count)), GRID, 1.0).wanted.shape == (1, 6)


def test_cells_that_should_read_nothing_have_no_error():
    target = CellTarget(weights=np.ones((1, 2)), wanted=np.zeros((1, 1)))
    assert target.error(np.ones((1, 2))) == 0
