import numpy as np
import pytest

from midair.solvers.problem import phase_change


def test_by_hand_and_nothing_before_pulls_nothing():
    """Two transducers; from the frame before, one turned by pi, one by 0: mean(1 - cos) = 1."""
    cost, _ = phase_change(np, np.exp(1j * np.array([[np.pi, 0.0]])), np.ones((1, 2), complex), 0.5)
    assert cost == pytest.approx(0.5)
    cost, gradient = phase_change(np, np.exp(1j * np.array([[1.0, 2.0]])), np.zeros((1, 2), complex), 0.5)
    assert cost == pytest.approx(0.5)
    np.testing.assert_array_equal(gradient, 0)


def test_it_is_half_the_mean_square_change_of_the_drive():
    q = np.exp(1j * np.random.default_rng(0).uniform(-3, 3, (4, 7)))
    cost, _ = phase_change(np, q[1:], q[:1], 0.3)
    np.testing.assert_allclose(cost, 0.3 * 0.5 * (np.abs(np.diff(q, axis=0)) ** 2).mean(axis=1))


def test_the_gradient_is_the_derivative_of_the_sum_over_all_rows():
    rng = np.random.default_rng(1)
    theta, before = rng.uniform(-3, 3, (3, 4)), np.exp(1j * rng.uniform(-3, 3, (1, 4)))
    gradient = phase_change(np, np.exp(1j * theta), before, 0.7)[1]
    for row in range(3):
        for n in range(4):
            step = np.zeros_like(theta)
            step[row, n] = 1e-6
            ahead, behind = (phase_change(np, np.exp(1j * (theta + s)), before, 0.7)[0].sum() for s in (step, -step))
            assert gradient[row, n] == pytest.approx((ahead - behind) / 2e-6, abs=1e-8)
