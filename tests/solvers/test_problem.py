import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.solvers.conftest import jacobian

from midair.solvers.problem import Problem, error_of, residual


def test_one_transducer_one_point_by_hand():
    """G = 2j, A = 1/2, theta = pi/2: G q = -1; p = 3, psi = pi: the residual is -1 + 3."""
    problem = Problem(G=np.array([[2j]]), amplitude=np.array([[3.0]]), level=0.5)
    assert residual(problem, np.array([3.0]), np.array([np.pi / 2, np.pi])) == pytest.approx(2.0)
    assert error_of(problem, np.array([[np.pi / 2]])) == pytest.approx(2 / 3)


def test_silence_has_no_error():
    problem = Problem(G=np.ones((2, 3)) * (1 + 0j), amplitude=np.zeros((1, 2)))
    assert error_of(problem, np.zeros((1, 3))) == 0


def test_jacobian_is_the_derivative_of_the_residual(random_problem):
    G, p, x = random_problem(7, 11, 1)
    problem, h = Problem(G=G, amplitude=p[None], level=0.7), 1e-6
    columns = []
    for k in range(len(x)):
        e = np.zeros_like(x)
        e[k] = h
        slope = (residual(problem, p, x + e) - residual(problem, p, x - e)) / (2 * h)
        columns.append(np.concatenate([slope.real, slope.imag]))
    np.testing.assert_allclose(jacobian(problem, p, x), np.stack(columns, axis=1), atol=1e-9)


@given(shift=st.floats(-10, 10), seed=st.integers(0, 1000))
def test_a_common_phase_changes_no_error(shift, seed):
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(4, 6)) + 1j * rng.normal(size=(4, 6))
    problem = Problem(G=G, amplitude=rng.uniform(0, 2, (3, 4)))
    theta = rng.uniform(-np.pi, np.pi, (3, 6))
    np.testing.assert_allclose(error_of(problem, theta + shift), error_of(problem, theta), rtol=1e-9)
