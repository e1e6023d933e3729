import numpy as np
import pytest
from tests.solvers.conftest import jacobian

from midair.solvers.levenberg_marquardt import LevenbergMarquardt, dual_step
from midair.solvers.problem import GuardField, Problem, error_of, excess_rows, residual

# Results of the plain form of the paper's method on ten patterns of strength .1 in 50 iterations, from zero.
PLAIN = {
    0x0001: 0.056,
    0x8001: 0.064,
    0x0660: 0.042,
    0xF99F: 0.049,
    0x5A5A: 0.071,
    0x1248: 0.073,
    0xFFFF: 0.010,
    0x00FF: 0.028,
    0x8421: 0.074,
    0x3C18: 0.061,
}


def lapack_step(problem, p, x, damping):
    """The damped step as a least-squares problem of its own, min || [J; sqrt(lambda) I] h + [f; 0] ||."""
    J, r = jacobian(problem, p, x), residual(problem, p, x)
    stacked = np.vstack([J, np.sqrt(damping) * np.eye(len(x))])
    return np.linalg.lstsq(stacked, -np.concatenate([r.real, r.imag, np.zeros(len(x))]), rcond=None)[0]


@pytest.mark.parametrize(("points", "transducers"), [(9, 30), (12, 5), (1, 1), (1, 8), (8, 1)])
@pytest.mark.parametrize("damping", [1e-4, 1.0])
def test_the_step_agrees_with_least_squares(random_problem, points, transducers, damping):
    G, p, x = random_problem(points, transducers, 3)
    problem, solver = Problem(G=G, amplitude=p[None], level=0.8), LevenbergMarquardt()
    state = solver.begin(problem, p, x)
    object.__setattr__(state, "damping", damping)
    expected = lapack_step(problem, p, x, damping)
    np.testing.assert_allclose(dual_step(problem, p, state), expected, rtol=1e-7, atol=1e-10)


def test_gradient_is_jacobian_transposed_times_residual(random_problem):
    G, p, x = random_problem(6, 9, 4)
    problem = Problem(G=G, amplitude=p[None])
    r = residual(problem, p, x)
    expected = jacobian(problem, p, x).T @ np.concatenate([r.real, r.imag])
    np.testing.assert_allclose(LevenbergMarquardt().begin(problem, p, x).gradient, expected, atol=1e-13)


def test_cost_never_rises_and_steps_can_be_shown(random_problem):
    G, p, x = random_problem(20, 30, 6)
    problem, solver = Problem(G=G, amplitude=p[None]), LevenbergMarquardt()
    states = [solver.begin(problem, p, x)]
    while states[-1].status is None and states[-1].iterations < 40:
        states.append(solver.step(problem, p, states[-1]))
    costs = np.array([state.cost for state in states])
    assert (np.diff(costs) <= 0).all()
    assert costs[-1] < 0.5 * costs[0]
    assert [state.iterations for state in states] == list(range(len(states)))


def test_a_field_that_the_array_can_make_is_found():
    """p is the field of known phases, so that E = 0 is possible; started close to them it is reached."""
    rng = np.random.default_rng(7)
    G = (rng.normal(size=(10, 40)) + 1j * rng.normal(size=(10, 40))) / 40
    problem = Problem(G=G, amplitude=np.abs(G @ np.exp(1j * rng.uniform(-np.pi, np.pi, 40)))[None])
    answer = LevenbergMarquardt().solve(problem)
    assert error_of(problem, answer.phase)[0] < 1e-6
    assert answer.status == ("converged",)
    assert answer.iterations[0] < 50


def errors_from_zero(transfer, points):
    problem = Problem(G=transfer, amplitude=0.1 * points)
    return error_of(problem, LevenbergMarquardt(start="zero").solve(problem).phase)


@pytest.mark.long
@pytest.mark.parametrize("pattern", [0x0001, 0x1248])
def test_a_pattern_no_worse_than_the_plain_form(pattern, transfer, patterns_to_points):
    assert errors_from_zero(transfer, patterns_to_points([pattern]))[0] <= PLAIN[pattern] + 0.0005


@pytest.mark.slow
def test_ten_patterns_no_worse_than_the_plain_form(transfer, patterns_to_points):
    error = errors_from_zero(transfer, patterns_to_points(PLAIN))
    assert error.mean() <= 0.0535
    assert (error <= np.array(list(PLAIN.values())) + 0.0005).all()


def test_at_the_minimum_the_gradient_vanishes_and_the_status_is_converged():
    """One point, one transducer, |G| < p: only the free phase can improve; then the gradient is 0."""
    problem = Problem(G=np.array([[0.5j]]), amplitude=np.array([[1.0]]))
    answer = LevenbergMarquardt().solve(problem)
    assert answer.status == ("converged",)
    assert error_of(problem, answer.phase)[0] == pytest.approx(0.5)


def guarded(points, transducers, seed=3):
    rng = np.random.default_rng(seed)
    G, ring = (
        (rng.normal(size=(m, transducers)) + 1j * rng.normal(size=(m, transducers))) / transducers
        for m in (points, points + 2)
    )
    p = rng.uniform(0.02, 0.2, (1, points))
    return Problem(G=G, amplitude=p, level=0.8, guard=GuardField(G=ring, ceiling=0.3, weight=0.6))


@pytest.mark.parametrize(("points", "transducers"), [(6, 20), (9, 5), (1, 1), (1, 8), (8, 1)])
@pytest.mark.parametrize("damping", [1e-4, 1.0])
def test_with_a_guard_the_steps_are_those_of_least_squares_with_its_rows(points, transducers, damping):
    problem = guarded(points, transducers)
    p, x = problem.amplitude[0], np.random.default_rng(1).uniform(-3, 3, transducers + points)
    state = LevenbergMarquardt().begin(problem, p, x)
    object.__setattr__(state, "damping", damping)
    J, r = jacobian(problem, p, x), residual(problem, p, x)
    e, B = excess_rows(problem.guard, x[:transducers], 0.8, p.max())
    assert len(e)
    rows = np.vstack([J, np.hstack([B, np.zeros((len(e), points))]), np.sqrt(damping) * np.eye(len(x))])
    right = -np.concatenate([r.real, r.imag, e, np.zeros(len(x))])
    expected = np.linalg.lstsq(rows, right, rcond=None)[0]
    np.testing.assert_allclose(dual_step(problem, p, state), expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(state.gradient, -(rows.T @ right), atol=1e-12)
    assert state.cost == pytest.approx(0.5 * right @ right)
