import numpy as np
import pytest
from tests.solvers.conftest import jacobian

from midair.model import ControlGrid
from midair.solvers import Exact, LevenbergMarquardt, Problem, error_of
from midair.solvers.exact import System
from midair.solvers.levenberg_marquardt import dual_step
from midair.solvers.modes import modes
from midair.solvers.phases import spreading_phase

TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)


@pytest.fixture(scope="module")
def ten(transfer, patterns_to_points, array, lossless):
    """The ten patterns at a strength: strength -> Problem."""
    psi = spreading_phase(ControlGrid(), array, lossless)
    return lambda strength: Problem(G=transfer, amplitude=strength * patterns_to_points(TEN), psi=psi)


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.parametrize(("points", "transducers"), [(7, 20), (12, 5), (1, 1)])
@pytest.mark.parametrize("damping", [1e-3, 0.3])
def test_the_step_is_that_of_the_textbook(random_problem, points, transducers, damping):
    G, p, x = random_problem(points, transducers, 2)
    p[::3] = 0
    problem = Problem(G=G, amplitude=p[None], level=0.6)
    system = System.of(modes(G), 0.6, "double")
    residual = system.residual(p, x)
    plain = LevenbergMarquardt().begin(problem, p, x)
    object.__setattr__(plain, "damping", damping)
    step = system.step(p, x, residual, damping, system.normal(x))
    np.testing.assert_allclose(step, dual_step(problem, p, plain), rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(system.gradient(p, x, residual), plain.gradient, atol=1e-13)


def test_two_symmetric_products_make_the_whole_of_k(random_problem):
    """K in the basis of the points: U K U^T is J_theta J_theta^T."""
    G, p, x = random_problem(8, 15, 3)
    system = System.of(modes(G), 0.7, "double")
    J = jacobian(Problem(G=G, amplitude=p[None], level=0.7), p, x)[:, :15]
    U = np.block([[system.U.real, -system.U.imag], [system.U.imag, system.U.real]])
    np.testing.assert_allclose(U @ system.normal(x) @ U.T, J @ J.T, atol=1e-14)


def test_single_precision_takes_nearly_the_same_step(transfer, patterns_to_points):
    p, x = 0.1 * patterns_to_points([0x5A5A])[0], np.random.default_rng(1).uniform(-np.pi, np.pi, 996 + 256)
    steps = []
    for precision in ("single", "double"):
        system = System.of(modes(transfer, tolerance=1e-2), 1.0, precision)
        steps.append(system.step(p, x, system.residual(p, x), 1e-5, system.normal(x)))
    assert np.linalg.norm(steps[0] - steps[1]) < 1e-3 * np.linalg.norm(steps[1])


def test_a_singular_system_gives_nan():
    system = System.of(modes(np.zeros((2, 3), complex)), 1.0, "double")
    x = np.zeros(5)
    step = system.step(np.ones(2), x, system.residual(np.ones(2), x), 0.0, system.normal(x))
    assert not np.isfinite(step).all()
