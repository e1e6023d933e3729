import numpy as np
import pytest

from midair.model import ControlGrid
from midair.solvers import Guard
from midair.solvers.problem import GuardField, excess, excess_rows


def test_the_ring_lies_around_the_square_and_no_wider_than_its_margin():
    grid = ControlGrid(centre=(0.01, -0.02))
    ring = Guard(margin=20e-3).points(grid)
    away = np.abs(ring[:, :2] - [0.01, -0.02]).max(axis=1)
    assert away.min() == pytest.approx(27.5e-3 + 11e-3 / 3)
    assert 27.5e-3 + 20e-3 - 11e-3 / 3 < away.max() <= 27.5e-3 + 20e-3
    np.testing.assert_array_equal(ring[:, 2], 0.2)
    # 26 x 26 points of the larger grid without the 16 x 16 of the square.
    assert len(ring) == 26**2 - 16**2


def test_another_pitch_keeps_the_ring_outside_and_another_grid_has_its_margin_on_each_side():
    for pitch in (5e-3, 2e-3, 11e-3 / 6):
        away = np.abs(Guard(margin=20e-3, pitch=pitch).points(ControlGrid())[:, :2]).max(axis=1)
        assert 27.5e-3 + 11e-3 / 6 < away.min() <= 27.5e-3 + 11e-3 / 6 + pitch, pitch
        assert 47.5e-3 - pitch < away.max() <= 47.5e-3 + 1e-9, pitch
    ring = Guard(margin=10e-3, pitch=5e-3).points(ControlGrid(rows=3, columns=7, pitch=5e-3))
    assert np.abs(ring[:, :2]).max(axis=0) == pytest.approx([25e-3, 15e-3])


def test_the_cost_by_hand_and_its_slope_as_the_derivative(complex_slope):
    """|3j| is 2 above 1, |.5| is below: weight 3 times 4 / 2 = 6, slope 3 * 2 along 3j."""
    cost, factor = excess(np, np.array([[3.0, 0.5]]), np.array([[1.0]]), 3.0)
    assert cost == pytest.approx(6)
    np.testing.assert_allclose(factor, [[2, 0]], atol=1e-12)
    rng = np.random.default_rng(1)
    y, ceiling = rng.normal(size=(3, 5)) + 1j * rng.normal(size=(3, 5)), np.array([[0.5], [1.0], [0.0]])
    slope = y * excess(np, abs(y), ceiling, 0.7)[1]
    np.testing.assert_allclose(slope, complex_slope(lambda z: excess(np, abs(z), ceiling, 0.7)[0], y), atol=1e-7)


def test_as_residuals_it_is_the_same_cost_and_slope():
    rng = np.random.default_rng(2)
    G = rng.normal(size=(6, 4)) + 1j * rng.normal(size=(6, 4))
    guard, theta = GuardField(G=G, ceiling=0.8, weight=2.0), rng.uniform(-3, 3, 4)
    residual, slope = excess_rows(guard, theta, 0.5, peak=1.5)
    assert 0 < len(residual) < 6
    y = (0.5 * np.exp(1j * theta)) @ G.T
    assert 0.5 * residual @ residual == pytest.approx(excess(np, abs(y[None]), np.array([[1.2]]), 2.0)[0][0])
    for n in range(4):
        step = np.zeros(4)
        step[n] = 1e-6
        ahead, behind = (excess_rows(guard, theta + s, 0.5, peak=1.5)[0] for s in (step, -step))
        np.testing.assert_allclose(slope[:, n], (ahead - behind) / 2e-6, atol=1e-7)
