import numpy as np
import pytest

from midair.solvers import LevenbergMarquardt, Problem
from midair.solvers.exact import System
from midair.solvers.levenberg_marquardt import primal_step
from midair.solvers.modes import modes
from midair.solvers.problem import jacobian


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
    np.testing.assert_allclose(step, primal_step(problem, p, plain), rtol=1e-8, atol=1e-11)
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
