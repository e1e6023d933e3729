import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.solvers import Problem
from midair.solvers.problem import GuardField
from midair.solvers.terms.amplitudes import doubled, halves


def test_alike_when_all_is_zero_the_two_are_a_right_angle_apart():
    """(exp(j pi/4) + exp(-j pi/4)) / 2 = cos(pi/4)."""
    theta, amplitude = halves(np.zeros((1, 2)))
    assert theta[0, 0] == pytest.approx(0)
    assert amplitude[0, 0] == pytest.approx(np.sqrt(0.5))


@given(amplitude=st.floats(0, 1), theta=st.floats(-3.1, 3.1), apart=st.floats(0, 1.5))
def test_every_drive_no_louder_than_full_is_the_mean_of_two_at_full(amplitude, theta, apart):
    half = np.arccos(amplitude)
    pair = np.array([[theta + half - apart, theta - half + apart]])
    found, loud = halves(pair, apart=apart)
    assert loud[0, 0] * np.exp(1j * found[0, 0]) == pytest.approx(amplitude * np.exp(1j * theta), abs=1e-12)


@given(seed=st.integers(0, 1000))
def test_the_doubled_problem_has_the_field_of_the_halves(seed):
    rng = np.random.default_rng(seed)
    G, ring = (rng.normal(size=(m, 5)) + 1j * rng.normal(size=(m, 5)) for m in (4, 3))
    problem = Problem(
        G=G, amplitude=rng.uniform(0, 1, (2, 4)), level=0.6, guard=GuardField(G=ring, ceiling=0.3, weight=2.0)
    )
    phase = rng.uniform(-3, 3, (2, 10))
    theta, amplitude = halves(phase)
    assert 0 <= amplitude.min() <= amplitude.max() <= 1
    q = 0.6 * amplitude * np.exp(1j * theta)
    double = doubled(problem)
    np.testing.assert_allclose(double.field(phase), q @ G.T, atol=1e-12)
    np.testing.assert_allclose((0.6 * np.exp(1j * phase)) @ double.guard.G.T, q @ ring.T, atol=1e-12)
