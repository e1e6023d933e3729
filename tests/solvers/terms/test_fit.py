import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, Medium, PressureFrames, TransducerArray
from midair.physics import SensorModel, cell_weights, propagate, radiation_pressure, sound_amplitude
from midair.solvers import Cells, SolverSettings, Windows, solve
from midair.solvers.problem import CellTarget, cell_misfit, misfit
from midair.targets import interpolation_matrix

GRID = ControlGrid()


def test_the_misfits_of_points_and_cells_by_hand():
    """|3 + 4j| = 5 against 3: cost 2, slope 2 along y; |-2| against 2: nothing."""
    cost, factor = misfit(np, np.array([[5.0, 2.0]]), np.array([[3.0, 2.0]]))
    assert cost == pytest.approx(2)
    np.testing.assert_allclose(factor, [[2 / 5, 0]], atol=1e-15)
    # Two cells, one of both points and one of the second: readings (1 + 4) / 2 and 4 against 2 and 4.
    weights = np.array([[0.5, 0.5], [0.0, 1.0]])
    size, wanted = np.array([[1.0, 2.0]]), np.array([[2.0, 4.0]])
    cost, factor = cell_misfit(np, size, weights.T, wanted, np.array([10.0]))
    assert cost == pytest.approx(10 * 0.5**2 / 2)
    np.testing.assert_allclose(factor, [[2 * 10 * 0.5 * 0.5, 2 * 10 * 0.5 * 0.5]])


def test_slopes_are_derivatives_and_silence_has_none(complex_slope):
    rng = np.random.default_rng(0)
    y, weights = rng.normal(size=(3, 5)) + 1j * rng.normal(size=(3, 5)), rng.uniform(0, 1, (5, 2))
    p, wanted, scale = rng.uniform(0, 2, (3, 5)), rng.uniform(0, 3, (3, 2)), np.array([1.0, 0.2, 3.0])
    by_points = complex_slope(lambda z: misfit(np, abs(z), p)[0], y)
    np.testing.assert_allclose(y * misfit(np, abs(y), p)[1], by_points, atol=1e-7)
    by_cells = complex_slope(lambda z: cell_misfit(np, abs(z), weights, wanted, scale)[0], y)
    np.testing.assert_allclose(y * cell_misfit(np, abs(y), weights, wanted, scale)[1], by_cells, atol=1e-6)
    cost, factor = misfit(np, np.zeros((1, 2)), np.ones((1, 2)))
    assert cost == pytest.approx(1)
    np.testing.assert_array_equal(0 * factor, 0)


def test_the_target_is_the_reading_of_the_points_or_a_given_pressure_in_pascal():
    amplitude = np.random.default_rng(1).uniform(0, 1, (2, GRID.count))
    target = Cells().target(amplitude, GRID, 1.0)
    np.testing.assert_allclose(target.wanted, amplitude**2 @ cell_weights(SensorModel(), GRID, between="lines").T)
    heard = target.weights @ amplitude[0] ** 2
    assert target.error(amplitude)[0] == pytest.approx(
        np.linalg.norm(heard - target.wanted[0]) / np.linalg.norm(target.wanted[0])
    )
    # Amplitude 1 exerts 2 Pa: 6 Pa are an amplitude squared of 3.
    pressure = PressureFrames(pressure=np.full((2, 4, 4), 6.0), rate=1000.0)
    target = Cells(pressure=pressure).target(np.ones((2, GRID.count)), GRID, 2.0)
    np.testing.assert_allclose(target.wanted, 3.0)
    nothing = CellTarget(weights=np.ones((1, 2)), wanted=np.zeros((1, 1)))
    assert nothing.error(np.ones((1, 2))) == 0


def test_windows_overlap_and_cover_whatever_the_points_cover(subtests):
    for fit, grid, shape in (
        ("windows", GRID, (13, 13)),
        ("fine-windows", GRID, (19, 19)),
        ("windows", ControlGrid(rows=11, columns=11, pitch=5.5e-3), (13, 13)),
        ("windows", ControlGrid(rows=16, columns=28), (13, 25)),
        ("windows", ControlGrid(rows=1, columns=2), (1, 1)),
    ):
        with subtests.test(fit=fit, shape=shape):
            windows = SolverSettings(fit=fit).means
            places = windows.places(grid).grid
            assert places.shape == shape
            assert windows.pitch <= windows.aperture / 2
            # Half a cell within the outermost points, which stay silent.
            assert min(shape) == 1 or abs(grid.x[0]) - abs(places.x[0]) == pytest.approx(windows.inset)


def test_they_go_where_the_grid_goes():
    amplitude = np.ones((1, GRID.count))
    for means in (Cells(), Windows()):
        here, moved = (means.target(amplitude, grid, 1.0) for grid in (GRID, ControlGrid(centre=(0.03, 0.01))))
        np.testing.assert_allclose(moved.weights, here.weights, atol=1e-12, err_msg=str(means))
        np.testing.assert_allclose(moved.wanted, here.wanted, atol=1e-12, err_msg=str(means))


def test_wanted_are_means_of_the_pressure_that_is_interpolated_kept_for_the_next_part():
    """Pressure interpolated linearly between cells, 10 times as dense as the control points."""
    sensor, cells = SensorModel(), np.random.default_rng(2).uniform(0, 1, 16)
    amplitude = np.sqrt(interpolation_matrix(sensor.grid, GRID) @ cells)[None]
    fine = ControlGrid(rows=180, columns=180, pitch=11e-3 / 30)
    expected = cell_weights(Windows().places(GRID), fine) @ (interpolation_matrix(sensor.grid, fine) @ cells)
    np.testing.assert_allclose(Windows().target(amplitude, GRID, 1.0).wanted[0], expected, rtol=2e-3)
    even = Windows().target(np.full((1, GRID.count), 2.0), GRID, 1.0)
    np.testing.assert_allclose(even.wanted, 4.0, rtol=1e-3)
    for grid, kept in ((ControlGrid(height=0.21), True), (ControlGrid(rows=60, columns=60, pitch=2e-3), False)):
        one, again = (Windows().target(np.ones((1, grid.count)), grid, 1.0).weights for _ in range(2))
        assert (one is again) == kept
        np.testing.assert_array_equal(one, again)


def test_the_error_of_a_faint_frame_is_relative_to_random_phases():
    """A uniform target of a hundredth of it, exceeded by a factor of 3: error 1/50 relative to it, not 2."""
    amplitude = np.sqrt(np.array([[1e-5], [4e-2]])) * np.ones((2, GRID.count))
    target = Windows(faint=1e-3).target(amplitude, GRID, 1.0)
    np.testing.assert_allclose(target.error(np.sqrt(3) * amplitude), [0.02, 2.0], rtol=0.02)


@pytest.mark.long
def test_a_sensor_that_is_moved_reads_the_same():
    """Error at six places, from points twice as dense: small for windows, not for cells."""
    grid, array = ControlGrid(height=0.1), TransducerArray.autd3(columns=1, rows=1)
    sensor, fine = SensorModel(), ControlGrid(rows=32, columns=32, pitch=11e-3 / 6, height=0.1)
    cells = np.random.default_rng(3).uniform(1, 3, (2, 16))
    pressed = cells @ interpolation_matrix(sensor.grid, grid).T
    target = AmplitudeFrames(amplitude=sound_amplitude(pressed, Medium()), rate=1000.0, grid=grid)
    worst: dict[str, list[float]] = {}
    for fit in ("windows", "cells"):
        drive = solve(target, array, method="fast", fit=fit).drive
        made = radiation_pressure(propagate(drive, fine), Medium())
        for moved in ((0.0, 0.0), (2e-3, 0.0), (2e-3, 2e-3), (4e-3, 4e-3), (5.5e-3, 0.0), (5.5e-3, 5.5e-3)):
            read = made @ cell_weights(sensor, fine, centre=moved, between="waves").T
            wanted = pressed @ cell_weights(sensor, grid, centre=moved, between="lines").T
            worst.setdefault(fit, []).append(float(np.linalg.norm(read - wanted) / np.linalg.norm(wanted)))
    assert max(worst["windows"]) < 0.01
    assert max(worst["windows"]) < 2 * min(worst["windows"])
    assert worst["cells"][0] < min(worst["windows"])
    assert worst["cells"][-1] > 10 * worst["windows"][-1]
