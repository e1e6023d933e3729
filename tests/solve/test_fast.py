import numpy as np
import pytest

from midair.model import ControlGrid
from midair.solve import Fast, Problem, relative_error
from midair.solve.fast import hold, phase_function, unit
from midair.solve.lens import spreading_phase
from midair.solve.modes import modes

TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)


@pytest.mark.parametrize(
    ("strength", "mean", "worst"),
    [
        # What the plain form of the paper's method reaches on the same ten patterns in 50 iterations.
        (0.1, 0.0527, 0.0737),
        (0.2, 0.1609, 0.2612),
    ],
)
def test_no_worse_than_the_papers_method(transfer, patterns_to_points, array, lossless, strength, mean, worst):
    psi = spreading_phase(ControlGrid(), array, lossless)
    problem = Problem(G=transfer, amplitude=strength * patterns_to_points(TEN), psi=psi)
    error = relative_error(problem, Fast().solve(problem).phase)
    assert error.mean() <= mean
    assert error.max() <= worst


def test_single_and_double_precision_reach_the_same_error(transfer, patterns_to_points, array, lossless):
    psi = spreading_phase(ControlGrid(), array, lossless)
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[:4]), psi=psi)
    single, double = (relative_error(problem, Fast(precision=p).solve(problem).phase) for p in ("single", "double"))
    np.testing.assert_allclose(single, double, atol=0.002)


def test_the_gradient_of_the_polish_is_the_derivative_of_its_cost():
    rng = np.random.default_rng(0)
    G = rng.normal(size=(6, 9)) + 1j * rng.normal(size=(6, 9))
    kept = modes(G)
    p, gain = rng.uniform(0, 1, (2, 6)), np.array([[0.7], [1.3]])
    function = phase_function((kept.U * kept.s).T, kept.V.T.copy(), p, gain)
    theta, h = rng.uniform(-3, 3, (2, 9)), 1e-6
    cost, gradient = function(theta)
    np.testing.assert_allclose(cost, 0.5 * ((gain * np.abs(np.exp(1j * theta) @ G.T) - p) ** 2).sum(axis=1), rtol=1e-10)
    for n in range(9):
        step = np.zeros((2, 9))
        step[:, n] = h
        slope = (function(theta + step)[0] - function(theta - step)[0]) / (2 * h)
        np.testing.assert_allclose(gradient[:, n], slope, atol=1e-7)


def test_frames_do_not_depend_on_their_batch(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[:3]))
    one, three = (
        Fast(batch=batch, field_iterations=10, iterations=5, more_iterations=0, precision="double") for batch in (1, 3)
    )
    np.testing.assert_allclose(one.solve(problem).phase, three.solve(problem).phase, atol=1e-6)


def test_unit_of_nothing_is_one():
    np.testing.assert_array_equal(unit(np.array([0, 2j])), [1, 1j])


def test_hold_keeps_the_last_audible_phases():
    phase = np.array([[9.0], [1.0], [9.0], [9.0], [2.0]])
    np.testing.assert_array_equal(hold(phase, np.array([1, 4]))[:, 0], [0, 1, 1, 1, 2])
