import numpy as np
import pytest

from midair.solvers.terms.points import misfit


def test_by_hand():
    """|3 + 4j| = 5 against 3: cost 2, slope 2 along y; |-2| against 2: nothing."""
    cost, slope = misfit(np, np.array([[3 + 4j, -2.0]]), np.array([[3.0, 2.0]]))
    assert cost == pytest.approx(2)
    np.testing.assert_allclose(slope, [[2 * (3 + 4j) / 5, 0]], atol=1e-15)


def test_silence_where_sound_is_wanted_has_a_cost_and_no_direction():
    cost, slope = misfit(np, np.zeros((1, 2), complex), np.ones((1, 2)))
    assert cost == pytest.approx(1)
    np.testing.assert_array_equal(slope, 0)


def test_the_slope_is_the_derivative(complex_slope):
    rng = np.random.default_rng(0)
    y, p = rng.normal(size=(3, 4)) + 1j * rng.normal(size=(3, 4)), rng.uniform(0, 2, (3, 4))
    slope = misfit(np, y.copy(), p)[1]
    np.testing.assert_allclose(slope, complex_slope(lambda z: misfit(np, z.copy(), p)[0], y), atol=1e-7)
