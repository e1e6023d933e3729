import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.solvers.conftest import random_matrix

from midair.model import ControlGrid, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers.modes import modes


def put_together(kept):
    return (kept.U * kept.s) @ kept.V.conj().T


@given(points=st.integers(1, 12), transducers=st.integers(1, 12), seed=st.integers(0, 999))
def test_tolerance_zero_is_exact(points, transducers, seed):
    G = random_matrix(points, transducers, seed)
    np.testing.assert_allclose(put_together(modes(G)), G, atol=1e-12)


def test_omitted_modes_are_below_the_tolerance_and_columns_are_orthonormal(transfer, subtests):
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-5, 0.0):
        with subtests.test(tolerance=tolerance):
            kept = modes(transfer, tolerance=tolerance)
            assert kept.s[-1] > tolerance * kept.s[0]
            left = np.linalg.norm(put_together(kept) - transfer, ord=2)
            assert left <= max(tolerance * (1 + 1e-6), 1e-12) * kept.s[0]
            if tolerance in (0.0, 1e-2):
                for basis in (kept.U, kept.V):
                    np.testing.assert_allclose(basis.conj().T @ basis, np.eye(kept.rank), atol=1e-8)


def test_ranks_of_the_papers_array_of_a_deficient_matrix_and_of_nothing(transfer):
    assert modes(transfer, tolerance=0.01).rank == 136
    G = random_matrix(4, 9, 0)
    assert modes(np.concatenate([G, G])).rank == 4
    kept = modes(np.zeros((3, 5), complex), tolerance=1e-2)
    assert kept.rank == 1
    np.testing.assert_array_equal(put_together(kept), np.zeros((3, 5)))


def test_a_sketch_has_the_modes_that_lapack_finds(subtests):
    """1024 points within 55 mm above one unit: far closer than sound can tell apart."""
    grid = ControlGrid(rows=32, columns=32, pitch=55e-3 / 31)
    fine = transfer_matrix(grid, TransducerArray.autd3(columns=1, rows=1))
    U, s, _ = np.linalg.svd(fine, full_matrices=False)
    for tolerance in (1e-1, 5e-3, 2e-3, 1e-4):
        with subtests.test(tolerance=tolerance):
            kept = modes(fine, tolerance=tolerance)
            assert kept.rank == (s > tolerance * s[0]).sum() < 0.75 * len(s)
            # No squared singular value is off by more than a hundredth of the squared tolerance.
            np.testing.assert_allclose(kept.s**2, s[: kept.rank] ** 2, rtol=0, atol=1.01e-2 * (tolerance * s[0]) ** 2)
            assert np.linalg.norm(put_together(kept) - fine, ord=2) <= tolerance * s[0]
            for basis in (kept.U, kept.V):
                np.testing.assert_allclose(basis.conj().T @ basis, np.eye(kept.rank), atol=1e-8)
            alike = np.linalg.norm(U[:, : kept.rank].conj().T @ kept.U, axis=0)
            np.testing.assert_allclose(alike[s[: kept.rank] > 10 * tolerance * s[0]], 1, atol=1e-6)


@pytest.mark.parametrize("points", [(1100, 60), pytest.param((1100, 1200), marks=pytest.mark.long)])
def test_many_points_without_few_modes_are_factored_as_exactly(points):
    G = random_matrix(*points, 3)
    kept = modes(G, tolerance=1e-3)
    assert kept.rank == min(points)
    np.testing.assert_allclose(put_together(kept), G, atol=1e-8)
