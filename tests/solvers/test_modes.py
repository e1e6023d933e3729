import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.solvers.modes import modes


def random_matrix(points, transducers, seed):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(points, transducers)) + 1j * rng.normal(size=(points, transducers))


def put_together(kept):
    return (kept.U * kept.s) @ kept.V.conj().T


@given(points=st.integers(1, 12), transducers=st.integers(1, 12), seed=st.integers(0, 999))
def test_tolerance_zero_is_exact(points, transducers, seed):
    G = random_matrix(points, transducers, seed)
    np.testing.assert_allclose(put_together(modes(G)), G, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5])
def test_what_is_left_out_is_below_the_tolerance(transfer, tolerance):
    kept = modes(transfer, tolerance=tolerance)
    left = np.linalg.norm(put_together(kept) - transfer, ord=2)
    assert left <= tolerance * kept.s[0] * (1 + 1e-6)
    assert kept.s[-1] > tolerance * kept.s[0]


@pytest.mark.parametrize("tolerance", [0.0, 1e-2])
def test_columns_are_orthonormal(transfer, tolerance):
    kept = modes(transfer, tolerance=tolerance)
    for basis in (kept.U, kept.V):
        np.testing.assert_allclose(basis.conj().T @ basis, np.eye(kept.rank), atol=1e-8)


def test_the_papers_array_has_136_modes_above_one_percent(transfer):
    assert modes(transfer, tolerance=0.01).rank == 136


def test_rank_of_a_deficient_matrix():
    G = random_matrix(4, 9, 0)
    assert modes(np.concatenate([G, G])).rank == 4


def test_nothing_at_all_has_one_mode():
    kept = modes(np.zeros((3, 5), complex), tolerance=1e-2)
    assert kept.rank == 1
    np.testing.assert_array_equal(put_together(kept), np.zeros((3, 5)))
