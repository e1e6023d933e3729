import numpy as np
import pytest

from midair.errors import MidairError
from midair.model import AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import SensorModel, cell_weights, propagate, radiation_pressure, sound_amplitude
from midair.solvers import Windows, solve
from midair.targets import interpolation_matrix

GRID = ControlGrid()


def test_thirteen_by_thirteen_over_the_papers_points():
    places = Windows().places(GRID).grid
    assert (places.rows, places.columns) == (13, 13)
    np.testing.assert_allclose(places.x[[0, 6, 12]], [-22e-3, 0, 22e-3], atol=1e-12)


@pytest.mark.parametrize(
    ("grid", "shape"),
    [
        (ControlGrid(rows=11, columns=11, pitch=5.5e-3), (13, 13)),
        (ControlGrid(rows=16, columns=28), (13, 25)),
        (ControlGrid(rows=1, columns=2), (1, 1)),
    ],
)
def test_windows_cover_whatever_the_points_cover(grid, shape):
    places = Windows().places(grid).grid
    assert (places.rows, places.columns) == shape


def test_wanted_are_means_of_the_pressure_that_is_interpolated():
    """Pressure interpolated linearly between cells, 10 times as dense as the control points."""
    sensor, cells = SensorModel(), np.random.default_rng(2).uniform(0, 1, 16)
    amplitude = np.sqrt(interpolation_matrix(sensor.grid, GRID) @ cells)[None]
    fine = ControlGrid(rows=180, columns=180, pitch=11e-3 / 30)
    expected = cell_weights(Windows().places(GRID), fine) @ (interpolation_matrix(sensor.grid, fine) @ cells)
    np.testing.assert_allclose(Windows().target(amplitude, GRID, 1.0).wanted[0], expected, rtol=2e-3)


def test_the_windows_go_where_the_grid_goes():
    amplitude = np.ones((1, GRID.count))
    moved = Windows().target(amplitude, ControlGrid(centre=(0.03, 0.01)), 1.0)
    here = Windows().target(amplitude, GRID, 1.0)
    np.testing.assert_allclose(moved.weights, here.weights, atol=1e-12)
    np.testing.assert_allclose(moved.wanted, here.wanted, atol=1e-12)


def test_an_even_pressure_is_wanted_evenly():
    target = Windows().target(np.full((1, GRID.count), 2.0), GRID, 1.0)
    np.testing.assert_allclose(target.wanted, 4.0, rtol=1e-3)


def test_the_error_of_a_faint_frame_is_relative_to_random_phases():
    """A uniform target of a hundredth of it, exceeded by a factor of 3: error 1/50 relative to it, not 2."""
    amplitude = np.sqrt(np.array([[1e-5], [4e-2]])) * np.ones((2, GRID.count))
    target = Windows(faint=1e-3).target(amplitude, GRID, 1.0)
    np.testing.assert_allclose(target.error(np.sqrt(3) * amplitude), [0.02, 2.0], rtol=0.02)


@pytest.mark.parametrize("name", ["aperture", "spread", "pitch", "inset"])
def test_windows_have_a_size(name):
    with pytest.raises(MidairError, match=f"{name} of the windows"):
        Windows(**{name: 0.0})


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
