import numpy as np
import pytest

from midair.solve import Exact, LevenbergMarquardt, Problem, relative_error
from midair.solve.exact import State, System
from midair.solve.levenberg_marquardt import primal_step
from midair.solve.modes import modes

TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)


@pytest.mark.parametrize(("points", "transducers"), [(7, 20), (12, 5), (1, 1)])
@pytest.mark.parametrize("damping", [1e-3, 0.3])
def test_the_step_is_that_of_the_textbook(random_problem, points, transducers, damping):
    G, p, x = random_problem(points, transducers, 2)
    p[::3] = 0
    problem = Problem(G=G, amplitude=p[None], level=0.6)
    system = System.of(modes(G), 0.6, "double")
    state = State.at(system, p, x, damping)
    plain = LevenbergMarquardt().begin(problem, p, x)
    object.__setattr__(plain, "damping", damping)
    np.testing.assert_allclose(system.step(p, state), primal_step(problem, p, plain), rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(system.gradient(p, state), plain.gradient, atol=1e-13)


def test_tolerance_zero_takes_the_same_way_as_the_plain_form(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN[3:5]))
    plain = LevenbergMarquardt(start="zero", iterations=6).solve(problem).phase
    exact = Exact(start="zero", iterations=6, tolerance=0, precision="double").solve(problem).phase
    np.testing.assert_allclose(exact, plain, atol=1e-6)


@pytest.mark.slow
def test_fewer_modes_and_single_precision_cost_little_error(transfer, patterns_to_points):
    problem = Problem(G=transfer, amplitude=0.1 * patterns_to_points(TEN))
    error = relative_error(problem, Exact(start="zero").solve(problem).phase)
    # The plain form: .0527 and .0736.
    assert error.mean() < 0.055
    assert error.max() < 0.076
