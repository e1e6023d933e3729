from dataclasses import replace

import numpy as np
import pytest
from tests.solvers.conftest import TEN, random_matrix

from midair.model import SensorGrid
from midair.solvers import PLAIN, LevenbergMarquardt, Problem, error_of

KNOWN = [0.056, 0.064, 0.042, 0.049, 0.071, 0.073, 0.010, 0.028, 0.074, 0.061]
"""E of an independent plain form on the ten patterns of strength .1, 50 iterations from zero."""


@pytest.mark.long
def test_ten_patterns_no_worse_than_an_independent_form(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN))
    error = error_of(problem, replace(PLAIN, start="zero").solve(problem).phase)
    assert error.mean() <= 0.0535
    assert (error <= np.array(KNOWN) + 0.0005).all()


@pytest.fixture(scope="module")
def ten(transfer, patterns_to_points, psi):
    """The ten patterns at a strength: strength -> Problem."""
    return lambda strength: Problem(G=transfer, amplitude=strength * patterns_to_points(TEN), psi=psi)


@pytest.mark.long
def test_thirteen_steps_are_no_worse_than_fifty_plain_ones(ten):
    for strength, mean, worst in ((0.1, 0.0527, 0.0736), (0.2, 0.1561, 0.2611)):
        error = error_of(ten(strength), LevenbergMarquardt(start="zero").solve(ten(strength)).phase)
        assert error.mean() < mean, strength
        assert error.max() < worst, strength


@pytest.mark.long
def test_a_frame_on_its_own_starts_from_a_field(ten):
    """One step from there equals many from zero; the next frame continues from it with a warm start."""
    problem = ten(0.1)
    twice = Problem(G=problem.G, amplitude=problem.amplitude[[2, 2]], psi=problem.psi)
    settings = {"iterations": 1, "warm_iterations": 4, "last": 0}
    alone, after, from_zero = (
        error_of(twice, LevenbergMarquardt(**settings, start=start, first=first).solve(twice).phase)
        for start, first in (("zero", "field"), ("previous", "field"), ("zero", "zero"))
    )
    assert alone.max() < 0.3 < 0.7 < from_zero.min()
    assert after[0] == pytest.approx(alone[0], abs=0.01)
    assert after[1] < 0.9 * after[0]


def test_failed_steps_raise_lambda_in_both_forms(random_problem):
    """With so little damping the first five steps fail; the sixth is taken. Without modes left out both forms agree."""
    G, p, _ = random_problem(6, 9, 4)
    problem = Problem(G=G, amplitude=p[None])
    for iterations, moved in ((5, False), (7, True)):
        plain = replace(PLAIN, iterations=iterations, tau=1e-6)
        phase = plain.solve(problem).phase
        assert phase.any() == moved
        # Single precision, so that the modal form is used.
        modal = replace(plain, precision="single", last=0).solve(problem).phase
        np.testing.assert_allclose(modal, phase, atol=1e-3)


def test_a_field_that_the_array_can_make_is_found_and_a_minimum_is_converged():
    """p is the field of known phases, so that E = 0 is possible; started close to them it is reached."""
    G, phase = random_matrix(10, 40, 7), np.random.default_rng(7).uniform(-np.pi, np.pi, 40)
    problem = Problem(G=G, amplitude=np.abs(G @ np.exp(1j * phase))[None])
    answer = PLAIN.solve(problem)
    assert error_of(problem, answer.phase)[0] < 1e-6
    assert answer.status == ("converged",)
    assert answer.iterations[0] < 50
    # One point, one transducer, |G| < p: only the free phase can improve; then the gradient is 0.
    problem = Problem(G=np.array([[0.5j]]), amplitude=np.array([[1.0]]))
    answer = PLAIN.solve(problem)
    assert answer.status == ("converged",)
    assert error_of(problem, answer.phase)[0] == pytest.approx(0.5)


def test_a_frame_starts_at_the_previous_one_through_silence_or_at_zero(random_problem):
    G, p, _ = random_problem(12, 6, 1)
    problem = Problem(G=G, amplitude=np.outer([0, 1, 0, 1, 1], p))
    few = replace(PLAIN, iterations=3, warm_iterations=2)
    warm, alone = few.solve(problem), replace(few, start="zero").solve(problem)
    assert warm.status == ("silent", "iterations", "silent", "iterations", "iterations")
    assert warm.iterations.tolist() == [0, 3, 0, 2, 2]
    assert alone.iterations.tolist() == [0, 3, 0, 3, 3]
    for each in (warm, alone):
        assert not each.phase[0].any()
        np.testing.assert_array_equal(each.phase[2], each.phase[1])
    np.testing.assert_array_equal(alone.phase[3], alone.phase[1])
    assert np.abs(warm.phase[3] - warm.phase[1]).max() > 0


@pytest.mark.long
def test_moving_blob_is_followed_below_one_percent(transfer, channels_to_points):
    """A Gaussian of 11 mm that moves at .25 m/s, its pressure modulated at 100 Hz."""
    time, sensor = np.arange(60) / 1000.0, SensorGrid()
    x = 0.25 * time - 0.011
    X, Y = np.meshgrid(sensor.x, sensor.y)
    shape = np.exp(-((X - x[:, None, None]) ** 2 + (Y - 0.3 * x[:, None, None]) ** 2) / (2 * 0.011**2))
    pressure = np.maximum(np.sin(2 * np.pi * 100 * time + 0.3), 0)
    moving = (shape * np.sqrt(pressure)[:, None, None]).reshape(60, 16)
    problem = Problem(G=transfer, amplitude=0.1 * channels_to_points(moving))
    answer = PLAIN.solve(problem)
    error = error_of(problem, answer.phase)
    assert error[10:].max() < 0.01
    assert error[[status != "silent" for status in answer.status]].mean() < 0.01
