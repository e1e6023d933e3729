from dataclasses import replace

import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import SensorModel, cell_weights, focus_amplitude, propagate, radiation_pressure, wavenumber
from midair.settings import best_mode
from midair.solvers import solve
from midair.solvers.phases import hold, needed_convergence, rippled, spreading_phase, unit


def test_units_ripples_and_held_phases():
    np.testing.assert_array_equal(unit(np.array([0, 2j])), [1, 1j])
    # Each turns by less than a third of a radian, and by a different angle.
    turned = np.angle(rippled(np.ones(12, complex)))
    assert 0.2 < np.abs(turned).max() <= 0.3
    assert len(np.unique(turned.round(6))) == 12
    phase = np.array([[9.0], [1.0], [9.0], [9.0], [2.0]])
    np.testing.assert_array_equal(hold(phase, np.array([1, 4]))[:, 0], [0, 1, 1, 1, 2])


def test_rays_of_the_edge_come_from_the_edge_of_the_array():
    """The slope of psi at the edge of the square, k sin(angle), points back to the edge of the array (small angles)."""
    grid, array, medium = ControlGrid(rows=1, columns=201, pitch=1e-4, height=1.0), TransducerArray.autd3(), Medium()
    psi = spreading_phase(grid, array, medium)
    k, x = wavenumber(array, medium), grid.position[:, 0]
    tangent = -(psi[-1] - psi[-2]) / (x[-1] - x[-2]) / k
    middle = (x[-1] + x[-2]) / 2
    assert middle + tangent * grid.height == pytest.approx(np.ptp(array.position[:, 0]) / 2, rel=0.02)


def test_the_spreading_phase_is_symmetric_flat_where_the_array_is_no_wider_and_goes_with_the_grid():
    array, medium = TransducerArray.autd3(), Medium()
    psi = spreading_phase(ControlGrid(), array, medium).reshape(16, 16)
    np.testing.assert_allclose(psi, psi[::-1, ::-1], atol=1e-9)
    assert not spreading_phase(ControlGrid(rows=8, columns=8, pitch=0.1), array, medium).any()
    assert not spreading_phase(ControlGrid(rows=1, columns=1), array, medium).any()
    here, there = (spreading_phase(ControlGrid(centre=c), array, medium) for c in ((0, 0), (0.02, -0.01)))
    np.testing.assert_allclose(here, there, atol=1e-6)


def test_the_needed_convergence_concentrates_a_plane_wave_to_the_amplitude():
    """An array of 100 transducers 1 cm apart, of 5 Pa m, has a plane wave of 5 Pa m * 1e4 / m2 * lambda."""
    grid, medium = ControlGrid(rows=2, columns=2, pitch=0.03), Medium()
    x, y = np.meshgrid(*2 * [0.01 * np.arange(10)])
    array = TransducerArray(position=np.stack([x, y, 0 * x], -1).reshape(-1, 3), normal=[[0, 0, 1]] * 100, pressure=5.0)
    plane = 5.0 * 100 / 0.09**2 * 2 * np.pi / wavenumber(array, medium)
    found = [needed_convergence(times * plane, grid, array, medium) for times in (0.5, 2.0, 2.5, 3.0, 9.0)]
    np.testing.assert_allclose(found, [0.3, 0.5, 0.75, 1.0, 1.0])
    row = replace(array, position=np.linspace(0, [0.09, 0, 0], 100))  # Its power is spread over 9 by 3 cm.
    assert needed_convergence(4 * plane, grid, row, medium) == pytest.approx(((4 / 3) ** 2 - 1) / 2)


@pytest.mark.long
def test_the_best_mode_holds_a_weak_touch_over_heights():
    """A spot that beats is read 3 mm above and below the palm with less of its own part wrong, by 4 dB and more."""
    best, grid, array, sensor = best_mode(), ControlGrid(), TransducerArray.autd3(columns=2, rows=2), SensorModel()
    air, how = best.acoustics.medium, {"acoustics": best.acoustics}
    x, y = (grid.position[:, :2] - [6e-3, -3e-3]).T
    beat = np.sqrt(1 + 0.6 * np.sin(2 * np.pi * np.arange(33)[:, None] / 32 + 100 * x))
    amplitude = 0.06 * focus_amplitude(grid, array, **how) * beat * np.exp(-(x**2 + y**2) / 4e-4)
    spot = AmplitudeFrames(amplitude=amplitude, rate=4e3, grid=grid)
    wanted = radiation_pressure(amplitude, air) @ cell_weights(sensor, grid, between="lines").T
    missed = []
    for solver in (best.solver.but(convergence=1.0), best.solver):
        found = solve(spot, array, solver, **how)
        for height in (-3e-3, 3e-3):
            field = np.abs(propagate(found.drive, replace(grid, height=grid.height + height), **how))
            cells = radiation_pressure(field, air) @ cell_weights(sensor, grid, between="waves").T
            apart = cells - wanted * (cells * wanted).sum() / (wanted**2).sum()
            missed.append(np.linalg.norm(apart - apart.mean(axis=0)))
    assert found.drive.provenance.steps[-1].settings["convergence"] == pytest.approx(0.42, abs=0.01)
    assert max(missed[2:]) < 10 ** (-4 / 20) * min(missed[:2])
