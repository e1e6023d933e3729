import numpy as np

from midair.solvers import Problem, error_of
from midair.solvers.backend import backend, taken
from midair.solvers.field_operators import FieldOperators
from midair.solvers.problem import CellTarget, GuardField, misfit


def draw(*shape, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def machine_of(**terms):
    amplitude = np.random.default_rng(7).uniform(0, 1, (2, 6))
    problem = Problem(G=draw(6, 9), amplitude=amplitude, level=0.8, **terms)
    return FieldOperators.of(problem, backend("numpy", precision="double"), tolerance=0.0, memory=4)


GUARD = GuardField(G=draw(5, 9, seed=1), ceiling=0.2, weight=0.7)
CELLS = CellTarget(weights=np.abs(draw(2, 6, seed=2)), wanted=np.array([[1.0, 2.0], [0.5, 3.0]]))
TERMS = {"points": {}, "guard": {"guard": GUARD}, "cells": {"cells": CELLS}, "both": {"guard": GUARD, "cells": CELLS}}


def test_the_gradient_by_the_phases_is_the_derivative(subtests):
    for terms in TERMS:
        with subtests.test(terms=terms):
            operators = machine_of(**TERMS[terms])
            function = operators.phase_function(operators.batch(np.arange(2), faintest=1e-12))
            theta, h = np.random.default_rng(0).uniform(-3, 3, (2, 9)), 1e-6
            gradient = function(theta)[1]
            assert np.abs(gradient).max() > 0.01
            for n in range(9):
                step = np.zeros((2, 9))
                step[:, n] = h
                slope = (function(theta + step)[0] - function(theta - step)[0]) / (2 * h)
                np.testing.assert_allclose(gradient[:, n], slope, rtol=1e-5, atol=1e-6)


def test_the_cost_is_half_the_square_of_the_error_whatever_the_loudness():
    for terms in ("points", "cells"):
        operators, theta = machine_of(**TERMS[terms]), np.random.default_rng(1).uniform(-3, 3, (2, 9))
        cost, _ = operators.phase_function(operators.batch(np.arange(2), faintest=1e-12))(theta)
        np.testing.assert_allclose(cost, error_of(operators.problem, theta) ** 2 / 2, rtol=1e-9, err_msg=terms)


def test_the_guards_ceiling_is_a_part_of_the_frames_own_peak():
    operators = machine_of(guard=GUARD)
    p, theta = operators.problem.amplitude, np.random.default_rng(1).uniform(-3, 3, (2, 9))
    cost, _ = operators.phase_function(operators.batch(np.arange(2), faintest=1e-12))(theta)
    inside = misfit(np, abs(operators.problem.field(theta)), p)[0]
    outside = np.abs(0.8 * np.exp(1j * theta) @ GUARD.G.T)
    above = np.maximum(outside - 0.2 * p.max(axis=1, keepdims=True), 0)
    expected = (inside + 0.7 * (above**2).sum(axis=1) / 2) / (p**2).sum(axis=1)
    np.testing.assert_allclose(cost, expected, rtol=1e-9)


def test_some_rows_of_a_batch_are_those_rows():
    operators = machine_of(cells=CELLS)
    batch = operators.batch(np.arange(2), faintest=1e-12)
    second = taken(np, batch, np.array([1]))
    alone = operators.batch(np.array([1]), faintest=1e-12)
    for part in ("p", "gain", "peak", "cells", "cell_scale"):
        np.testing.assert_array_equal(getattr(second, part), getattr(alone, part))


def test_polish_gives_each_row_back_in_its_place():
    """Rows that start at their solution stay there, whichever of them are the worst quarter."""
    operators = machine_of()
    theta = np.random.default_rng(4).uniform(-3, 3, (2, 9))
    problem = Problem(G=operators.problem.G, amplitude=np.abs(operators.problem.field(theta)), level=0.8)
    operators = FieldOperators.of(problem, operators.backend, tolerance=0.0, memory=4)
    far = theta.copy()
    far[0] += 0.05
    found = operators.refine(far, operators.batch(np.arange(2), faintest=1e-12), 3, more=3)
    np.testing.assert_allclose(found[1], theta[1], atol=1e-6)
    assert 0 < np.abs(found[0] - theta[0]).max() < 0.5
