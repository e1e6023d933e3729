"""Terms by hand and by their derivatives: guard, smoothness, a range of temperatures, amplitudes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.model import Acoustics, ControlGrid, Medium, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers import Guard, Problem
from midair.solvers.problem import GuardField, excess, excess_rows, phase_change
from midair.solvers.terms.amplitudes import doubled, halves
from midair.solvers.terms.temperatures import airs_around, psi_at_temperatures


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


def test_by_hand_and_as_half_the_mean_square_change_of_the_drive():
    """Two transducers; from the frame before, one turned by pi, one by 0: mean(1 - cos) = 1."""
    cost, _ = phase_change(np, np.exp(1j * np.array([[np.pi, 0.0]])), np.ones((1, 2), complex), 0.5)
    assert cost == pytest.approx(0.5)
    cost, gradient = phase_change(np, np.exp(1j * np.array([[1.0, 2.0]])), np.zeros((1, 2), complex), 0.5)
    assert cost == pytest.approx(0.5)
    np.testing.assert_array_equal(gradient, 0)
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


ROOM = Acoustics(medium=Medium.at(temperature=22.0, humidity=0.3), directivity="point")


def test_the_airs_reach_both_ends_in_steps_of_two_degrees_at_most():
    """Stated constants get faster and slower."""
    expected = {0.0: [], 1.0: [-1, 1], 2.0: [-2, 2], 3.0: [-3, -1.5, 1.5, 3], 4.0: [-4, -2, 2, 4]}
    for robust, others in expected.items():
        airs = airs_around(ROOM, robust)
        assert airs[0] == ROOM, robust
        assert [each.medium.temperature - 22.0 for each in airs[1:]] == pytest.approx(others), robust
        assert {(each.directivity, each.medium.humidity) for each in airs} == {("point", 0.3)}, robust
    _, colder, warmer = airs_around(Acoustics(), 2.0)
    assert colder.medium.speed < 339 < 341 < warmer.medium.speed


def test_one_drive_makes_all_fields_that_a_solver_begins_with():
    """With the drive that focuses on one point, the phase there is that of a path: k r of each air, from the same r."""
    array, grid = TransducerArray.autd3(columns=1, rows=1), ControlGrid(rows=1, columns=1)
    G = [transfer_matrix(grid, array, acoustics=air) for air in airs_around(ROOM, 2.0)]
    own, colder, warmer = psi_at_temperatures(G, np.array([0.7]))
    assert own == 0.7
    # 745 rad/m at 22 degrees, .17 % less for each degree, over 210 mm or a little more.
    assert np.angle(np.exp(1j * (colder - own))) == pytest.approx(0.55, abs=0.03)
    assert np.angle(np.exp(1j * (warmer - own))) == pytest.approx(-0.55, abs=0.03)


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
