import numpy as np

from midair.solvers.lbfgs import LBFGS


def quadratics(rows, unknowns, seed=0):
    """Rows x^T H x / 2 - b^T x with H of condition 100, and their minima."""
    rng = np.random.default_rng(seed)
    turns = np.linalg.qr(rng.normal(size=(rows, unknowns, unknowns)))[0]
    H = np.einsum("rij,j,rkj->rik", turns, np.geomspace(1, 100, unknowns), turns)
    b = rng.normal(size=(rows, unknowns))

    def function(x):
        slope = np.einsum("rij,rj->ri", H, x) - b
        return 0.5 * np.vecdot(x, slope - b), slope

    return function, np.stack([np.linalg.solve(h, v) for h, v in zip(H, b, strict=True)])


def test_finds_the_minima_of_quadratics():
    function, minima = quadratics(5, 12)
    state = LBFGS(memory=12).run(function, np.zeros((5, 12)), np.full(5, 0.01), 80)
    np.testing.assert_allclose(state.x, minima, atol=1e-6)


def test_rows_know_nothing_of_each_other():
    function, _ = quadratics(4, 6)
    together = LBFGS().run(function, np.ones((4, 6)), np.full(4, 0.01), 9).x

    def second(x):
        cost, slope = function(np.repeat(x, 4, axis=0))
        return cost[1:2], slope[1:2]

    alone = LBFGS().run(second, np.ones((1, 6)), np.full(1, 0.01), 9).x
    np.testing.assert_allclose(alone[0], together[1], rtol=1e-10)


def test_cost_never_rises_even_from_a_step_that_is_far_too_long():
    function, _ = quadratics(3, 8)
    method = LBFGS()
    state = method.begin(function, np.ones((3, 8)), np.full(3, 1e3))
    costs = [state.cost]
    for _ in range(60):
        method.step(function, state)
        costs.append(state.cost)
    assert (np.diff(costs, axis=0) <= 1e-12).all()
    assert (costs[-1] < costs[0]).all()


def test_precision_is_kept_and_a_minimum_is_not_left():
    for kind in (np.float32, np.float64):
        state = LBFGS().run(lambda x: (np.vecdot(x, x), 2 * x), np.ones((2, 3), kind), np.ones(2, kind), 5)
        assert state.x.dtype == kind
        np.testing.assert_allclose(state.x, 0, atol=1e-6, err_msg=str(kind))
    still = LBFGS().run(lambda x: (np.zeros(len(x)), np.zeros_like(x)), np.ones((2, 3)), np.ones(2), 5)
    np.testing.assert_array_equal(still.x, np.ones((2, 3)))
