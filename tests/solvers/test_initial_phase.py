import numpy as np
import pytest

from midair.model import ControlGrid, Medium, TransducerArray
from midair.physics import wavenumber
from midair.solvers.initial_phase import spreading_phase


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
    assert not spreading_phase(ControlGrid(pitch=0.1), array, medium).any()
    assert not spreading_phase(ControlGrid(rows=1, columns=1), array, medium).any()


def test_moving_the_grid_moves_the_spreading_phase():
    array, medium = TransducerArray.autd3(), Medium()
    here, there = (spreading_phase(ControlGrid(centre=c), array, medium) for c in ((0, 0), (0.02, -0.01)))
    np.testing.assert_allclose(here, there, atol=1e-6)
