import numpy as np
import pytest

from midair.model import ControlGrid
from midair.solvers import Exact, LevenbergMarquardt, Problem, error_of
from midair.solvers.phases import spreading_phase

TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)


@pytest.fixture(scope="module")
def ten(transfer, patterns_to_points, array, lossless):
    """The ten patterns at a strength: strength -> Problem."""
    psi = spreading_phase(ControlGrid(), array, lossless)
    return lambda strength: Problem(G=transfer, amplitude=strength * patterns_to_points(TEN), psi=psi)


def test_tolerance_zero_takes_the_same_way_as_the_plain_form(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[3:5]))
    plain = LevenbergMarquardt(start="zero", iterations=6).solve(problem).phase
    settings = Exact(start="zero", first="zero", iterations=6, tolerance=0, precision="double")
    np.testing.assert_allclose(settings.solve(problem).phase, plain, atol=1e-6)


def test_failed_steps_raise_lambda_as_in_the_plain_form(random_problem):
    """With so little damping the first five steps fail; the sixth is taken."""
    G, p, _ = random_problem(6, 9, 4)
    problem, settings = Problem(G=G, amplitude=p[None]), {"tau": 1e-6, "first": "zero", "tolerance": 0}
    for iterations, moved in ((5, False), (7, True)):
        plain = LevenbergMarquardt(iterations=iterations, tau=1e-6).solve(problem).phase
        exact = Exact(iterations=iterations, precision="double", **settings).solve(problem).phase
        assert plain.any() == moved
        np.testing.assert_allclose(exact, plain, atol=1e-6)


def test_a_frame_on_its_own_starts_from_a_field(ten):
    """One step from there equals many from zero; the next frame continues from it with a warm start."""
    problem = ten(0.1)
    twice = Problem(G=problem.G, amplitude=problem.amplitude[[2, 2]], psi=problem.psi)
    settings = {"iterations": 1, "warm_iterations": 4, "last": 0}
    alone, after, from_zero = (
        error_of(twice, Exact(**settings, start=start, first=first).solve(twice).phase)
        for start, first in (("zero", "field"), ("previous", "field"), ("zero", "zero"))
    )
    assert alone.max() < 0.3 < 0.7 < from_zero.min()
    assert after[0] == pytest.approx(alone[0], abs=0.01)
    assert after[1] < 0.9 * after[0]


@pytest.mark.slow
@pytest.mark.parametrize(("strength", "mean", "worst"), [(0.1, 0.0527, 0.0736), (0.2, 0.1561, 0.2611)])
def test_no_worse_than_fifty_plain_steps(ten, strength, mean, worst):
    """Mean and worst E of benchmarks' plain form on the ten patterns, 50 steps from zero."""
    problem = ten(strength)
    error = error_of(problem, Exact(start="zero").solve(problem).phase)
    assert error.mean() < mean
    assert error.max() < worst
