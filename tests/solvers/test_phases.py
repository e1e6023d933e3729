import numpy as np
import pytest

from midair.model import ControlGrid, Medium, TransducerArray
from midair.physics import wavenumber
from midair.solvers.phases import hold, rippled, spreading_phase, unit


def test_unit_of_nothing_is_one():
    np.testing.assert_array_equal(unit(np.array([0, 2j])), [1, 1j])


def test_a_ripple_turns_each_by_less_than_a_third_of_a_radian_and_differently():
    turned = np.angle(rippled(np.ones(12, complex)))
    assert 0.2 < np.abs(turned).max() <= 0.3
    assert len(np.unique(turned.round(6))) == 12


def test_hold_keeps_the_last_audible_phases():
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


def test_symmetric_and_flat_where_the_array_is_no_wider():
    array, medium = TransducerArray.autd3(), Medium()
    psi = spreading_phase(ControlGrid(), array, medium).reshape(16, 16)
    np.testing.assert_allclose(psi, psi[::-1, ::-1], atol=1e-9)
    assert not spreading_phase(ControlGrid(rows=8, columns=8, pitch=0.1), array, medium).any()
    assert not spreading_phase(ControlGrid(rows=1, columns=1), array, medium).any()


def test_moving_the_grid_moves_the_spreading_phase():
    array, medium = TransducerArray.autd3(), Medium()
    here, there = (spreading_phase(ControlGrid(centre=c), array, medium) for c in ((0, 0), (0.02, -0.01)))
    np.testing.assert_allclose(here, there, atol=1e-6)
