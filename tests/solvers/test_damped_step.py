"""The residual of a problem, its derivative, and the damped steps of both forms."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.solvers.conftest import random_matrix

from midair.solvers import LevenbergMarquardt
from midair.solvers.damped_step import ModalForm, PlainForm
from midair.solvers.modes import modes
from midair.solvers.problem import GuardField, Problem, error_of, excess_rows, residual

SIZES = [(9, 30), (12, 5), (1, 1), (1, 8), (8, 1)]
"""Numbers of points and transducers."""


def jacobian(problem, p, x):
    """Derivative of [Re; Im] of the residual by x, shape (2 point, transducer + point)."""
    theta, psi = x[: problem.transducers], x[problem.transducers :]
    slopes = np.hstack([1j * problem.level * problem.G * np.exp(1j * theta), np.diag(-1j * p * np.exp(1j * psi))])
    return np.vstack([slopes.real, slopes.imag])


def stepped(form, p, x, damping):
    """State and step of a form."""
    state = replace(form.at(p, x, damping), normal=form.normal(p, x))
    return state, form.step(p, state)


def test_the_step_of_both_forms_is_that_of_least_squares(random_problem, subtests):
    """min || [J; sqrt(lambda) I] h + [f; 0] ||."""
    for (points, transducers), damping in product(SIZES, [1e-3, 0.5]):
        with subtests.test(points=points, transducers=transducers, damping=damping):
            G, p, x = random_problem(points, transducers, 3)
            p[1::3] = 0
            problem = Problem(G=G, amplitude=p[None], level=0.6)
            J, r = jacobian(problem, p, x), residual(problem, p, x)
            f = np.concatenate([r.real, r.imag])
            stacked = np.vstack([J, np.sqrt(damping) * np.eye(len(x))])
            expected = np.linalg.lstsq(stacked, -np.concatenate([f, np.zeros(len(x))]), rcond=None)[0]
            for form in (PlainForm(problem=problem), ModalForm.of(modes(G), 0.6, "double")):
                state, step = stepped(form, p, x, damping)
                np.testing.assert_allclose(step, expected, rtol=1e-7, atol=1e-10)
                np.testing.assert_allclose(state.gradient, J.T @ f, atol=1e-13)
                assert state.cost == pytest.approx(0.5 * f @ f)


def test_with_a_guard_the_steps_are_those_of_least_squares_with_its_rows(subtests):
    for (points, transducers), damping in product(SIZES, [1e-4, 1.0]):
        with subtests.test(points=points, transducers=transducers, damping=damping):
            G, ring = random_matrix(points, transducers, 3), random_matrix(points + 2, transducers, 4)
            rng = np.random.default_rng(3)
            p, x = rng.uniform(0.02, 0.2, points), rng.uniform(-3, 3, transducers + points)
            problem = Problem(G=G, amplitude=p[None], level=0.8, guard=GuardField(G=ring, ceiling=0.3, weight=0.6))
            J, r = jacobian(problem, p, x), residual(problem, p, x)
            e, B = excess_rows(problem.guard, x[:transducers], 0.8, p.max())
            assert len(e)
            rows = np.vstack([J, np.hstack([B, np.zeros((len(e), points))]), np.sqrt(damping) * np.eye(len(x))])
            right = -np.concatenate([r.real, r.imag, e, np.zeros(len(x))])
            state, step = stepped(PlainForm(problem=problem), p, x, damping)
            np.testing.assert_allclose(step, np.linalg.lstsq(rows, right, rcond=None)[0], rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(state.gradient, -(rows.T @ right), atol=1e-12)
            assert state.cost == pytest.approx(0.5 * right @ right)


def test_single_precision_takes_nearly_the_same_step(transfer, patterns_to_points):
    p, x = 0.1 * patterns_to_points([0x5A5A])[0], np.random.default_rng(1).uniform(-np.pi, np.pi, 996 + 256)
    single, double = (
        stepped(ModalForm.of(modes(transfer, tolerance=1e-2), 1.0, precision), p, x, 1e-5)[1]
        for precision in ("single", "double")
    )
    assert np.linalg.norm(single - double) < 1e-3 * np.linalg.norm(double)


def test_a_singular_system_gives_nan():
    G = np.zeros((2, 3), complex)
    plain = PlainForm(problem=Problem(G=G, amplitude=np.zeros((1, 2))))
    for form, p in ((ModalForm.of(modes(G), 1.0, "double"), np.ones(2)), (plain, np.zeros(2))):
        assert np.isnan(stepped(form, p, np.zeros(5), 0.0)[1]).all()


def test_the_cost_never_rises_and_steps_can_be_shown(random_problem):
    G, p, x = random_problem(20, 30, 6)
    form, method = PlainForm(problem=Problem(G=G, amplitude=p[None])), LevenbergMarquardt()
    states = [form.at(p, x, 1e-4)]
    while states[-1].status is None and states[-1].iterations < 40:
        states.append(method.step(form, p, states[-1]))
    costs = np.array([state.cost for state in states])
    assert (np.diff(costs) <= 0).all()
    assert costs[-1] < 0.5 * costs[0]
    assert [state.iterations for state in states] == list(range(len(states)))


def test_one_transducer_one_point_and_silence_by_hand():
    """G = 2j, A = 1/2, theta = pi/2: G q = -1; p = 3, psi = pi: the residual is -1 + 3."""
    problem = Problem(G=np.array([[2j]]), amplitude=np.array([[3.0]]), level=0.5)
    assert residual(problem, np.array([3.0]), np.array([np.pi / 2, np.pi])) == pytest.approx(2.0)
    assert error_of(problem, np.array([[np.pi / 2]])) == pytest.approx(2 / 3)
    problem = Problem(G=np.ones((2, 3)) * (1 + 0j), amplitude=np.zeros((1, 2)))
    assert error_of(problem, np.zeros((1, 3))) == 0


def test_jacobian_is_the_derivative_of_the_residual(random_problem):
    G, p, x = random_problem(7, 11, 1)
    problem, h = Problem(G=G, amplitude=p[None], level=0.7), 1e-6
    columns = []
    for k in range(len(x)):
        e = np.zeros_like(x)
        e[k] = h
        slope = (residual(problem, p, x + e) - residual(problem, p, x - e)) / (2 * h)
        columns.append(np.concatenate([slope.real, slope.imag]))
    np.testing.assert_allclose(jacobian(problem, p, x), np.stack(columns, axis=1), atol=1e-9)


@given(shift=st.floats(-10, 10), seed=st.integers(0, 1000))
def test_a_common_phase_changes_no_error(shift, seed):
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(4, 6)) + 1j * rng.normal(size=(4, 6))
    problem = Problem(G=G, amplitude=rng.uniform(0, 2, (3, 4)))
    theta = rng.uniform(-np.pi, np.pi, (3, 6))
    np.testing.assert_allclose(error_of(problem, theta + shift), error_of(problem, theta), rtol=1e-9)
