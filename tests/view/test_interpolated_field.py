import numpy as np
import pytest
from tests.view.shown import finer_points

from midair.model import ControlGrid, Drive, TransducerArray
from midair.physics import focus_phase, propagate, transfer_matrix
from midair.view import Kind, encode_counts, fit_interpolation

ARRAY = TransducerArray.autd3()
GRID = ControlGrid()


@pytest.fixture(scope="module")
def made():
    return fit_interpolation(GRID, ARRAY)


def miss(found, true):
    return np.linalg.norm(found - true) / np.linalg.norm(true)


def focus(place, grid=GRID, times=4):
    """Fields of a focus at the control points, and at finer points."""
    phase = focus_phase(ARRAY, np.array([*place, grid.height]))[None]
    drive = Drive(phase=phase, level=np.ones(1), rate=1000, array=ARRAY)
    fine = propagate(drive, finer_points(grid, times)).reshape(times * grid.rows, times * grid.columns)
    return propagate(drive, grid).reshape(grid.rows, grid.columns), fine


@pytest.mark.long
def test_a_focus_is_within_two_per_cent_of_its_field(made):
    for place in ((0, 0), (-6e-3, 6e-3), (20e-3, -20e-3)):
        coarse, true = focus(place)
        assert miss(made(coarse), true) < 0.02, place


@pytest.mark.long
def test_any_phases_are_within_one_per_cent_and_magnitudes_alone_are_not(made):
    q = np.exp(2j * np.pi * np.random.default_rng(0).random((4, ARRAY.count)))
    coarse = (q @ transfer_matrix(GRID, ARRAY).T).reshape(-1, 16, 16)
    true = (q @ transfer_matrix(finer_points(GRID), ARRAY).T).reshape(-1, 64, 64)
    assert miss(made(coarse), true) < 0.01
    assert miss(np.abs(made(np.abs(coarse))), np.abs(true)) > 0.1


@pytest.mark.long
def test_counts_of_eight_bits_are_enough(made):
    """Without noise in the fit, a focus in eight bits was off by 2.4 times its norm."""
    coarse, true = focus((-6e-3, 6e-3))
    for bits, error in (("<i2", 0.005), ("i1", 0.03)):
        sent = encode_counts(coarse.reshape(1, -1), Kind.FIELD, dtype=bits, rate=1000)
        pairs = (sent.values * sent.unit).reshape(16, 16, 2)
        assert miss(made(pairs[..., 0] + 1j * pairs[..., 1]), true) < error, bits


def test_a_grid_that_is_not_square_and_a_row_alone_that_has_no_neighbours_to_be_fitted_from():
    grid = ControlGrid(rows=8, columns=12)
    coarse, true = focus((5e-3, -3e-3), grid, 3)
    assert miss(fit_interpolation(grid, ARRAY, times=3)(coarse), true) < 0.02
    assert fit_interpolation(ControlGrid(rows=1, columns=4), ARRAY).down.shape == (4, 1)
