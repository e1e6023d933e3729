import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.calibration import undo_matrix
from midair.errors import InputError
from midair.model import Crosstalk


def crosstalk(matrix):
    return Crosstalk(matrix=np.array(matrix, float), uncertainty=np.zeros(np.shape(matrix)))


def test_inverse_of_hand_computed_matrices():
    # [[1, .5], [0, 1]]: the part of the second cell is subtracted from the first
    assert undo_matrix(crosstalk([[1, 0.5], [0, 1]])) == pytest.approx(np.array([[1, -0.5], [0, 1]]))
    # a scalar-like case: C = [[1, c], [c, 1]], d: on the difference mode 1 - c, (1 - c + d^2) / ((1 - c)^2 + d^2)
    c, d = 0.5, 0.3
    undone = undo_matrix(crosstalk([[1, c], [c, 1]]), damping=d) @ [1, -1]
    assert undone == pytest.approx(np.array([1, -1]) * (1 - c + d**2) / ((1 - c) ** 2 + d**2))


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_crosstalk_round_trip(seed, strength):
    rng = np.random.default_rng(seed)
    matrix = strength * rng.uniform(-1, 1, (6, 6))
    np.fill_diagonal(matrix, 1)
    pressure = rng.standard_normal((50, 6))
    felt = pressure @ matrix.T
    assert felt @ undo_matrix(crosstalk(matrix)).T == pytest.approx(pressure, abs=1e-9)
    # with strong damping the pressure is unchanged
    assert felt @ undo_matrix(crosstalk(matrix), damping=1e4).T == pytest.approx(felt, abs=1e-6)


def test_invalid_crosstalk_is_rejected():
    even = crosstalk(np.ones((2, 2)))
    with pytest.raises(InputError, match="condition"):
        undo_matrix(even)
    assert np.isfinite(undo_matrix(even, damping=0.1)).all()
    with pytest.raises(InputError, match="damping"):
        undo_matrix(even, damping=-1.0)
