from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from tests.solvers.conftest import jacobian, random_matrix

from midair.solvers import LevenbergMarquardt
from midair.solvers.damped_step import ModalForm, PlainForm
from midair.solvers.modes import modes
from midair.solvers.problem import GuardField, Problem, excess_rows, residual

SIZES = [(9, 30), (12, 5), (1, 1), (1, 8), (8, 1)]
"""Numbers of points and transducers."""


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
