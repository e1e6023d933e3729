"""L-BFGS row by row, and its ring with a fixed number of launches and no synchronisation."""

from collections import Counter

import numpy as np
import pytest

from midair.solvers import Problem
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.lbfgs import LBFGS, RingLBFGS


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


ROWS = 512
VIEWS = {
    *("view", "_unsafe_view", "expand", "slice", "select", "t", "transpose", "permute", "unsqueeze", "squeeze"),
    *("as_strided", "detach", "alias", "diagonal", "view_as_real", "view_as_complex", "_conj", "real", "imag"),
    *("empty", "empty_like", "empty_strided", "lift_fresh"),
}
"""Operations without a launch: views, and allocation without initialisation."""
WAITS = {"_local_scalar_dense", "is_nonzero", "equal", "nonzero", "item", "_to_copy", "masked_select", "_unique2"}
"""Operations that the host waits for; a copy to another device counts, since it may wait."""


def launches():
    """Count, by PyTorch's dispatch on a CPU, launches (`made`), `waits` and bytes `moved` of a GPU."""
    mode = pytest.importorskip("torch.utils._python_dispatch").TorchDispatchMode

    class Launches(mode):
        made, waits, moved = Counter(), 0, 0

        def __torch_dispatch__(self, function, types, args=(), kwargs=None):
            result = function(*args, **(kwargs or {}))
            name = function.overloadpacket.__name__
            self.waits += name in WAITS
            if name not in VIEWS:
                self.made[name] += 1
                tensors = [one for one in [*args, result] if hasattr(one, "element_size")]
                self.moved += sum(one.numel() * one.element_size() for one in tensors)
            return result

    counted = Launches()
    counted.made = Counter()
    return counted


@pytest.fixture(scope="module")
def patterns(transfer, psi, channels_to_points):
    bits = (np.arange(1, ROWS + 1)[:, None] >> np.arange(16)) & 1
    return Problem(G=transfer, amplitude=0.1 * channels_to_points(bits.astype(float)), psi=psi)


@pytest.fixture
def there(library):
    return backend(library, precision="double")


def bumpy(xp, depth):
    """A function with rejected steps, and pairs without positive curvature."""

    def function(x):
        return depth * xp.sum(1 - xp.cos(x), axis=1) + 0.05 * xp.sum(x * x, axis=1), depth * xp.sin(x) + 0.1 * x

    return function


def test_the_same_steps_as_the_list_of_pairs(there):
    start = np.random.default_rng(3).uniform(-6, 6, (40, 5))
    step = np.full(40, 0.8)
    plain, ring = LBFGS(memory=4), RingLBFGS(memory=4, xp=there.xp)
    known, state = (
        plain.begin(bumpy(np, 2.0), start, step),
        ring.begin(bumpy(there.xp, 2.0), there.put(start), there.put(step)),
    )
    failed = dead = 0
    for _ in range(14):
        before = known.length
        plain.step(bumpy(np, 2.0), known)
        ring.step(bumpy(there.xp, 2.0), state)
        failed += int((known.length < before).sum())
        dead += int((known.pairs[-1][2] == 0).sum())
        for name in ("x", "gradient", "cost", "scale", "length"):
            np.testing.assert_allclose(there.get(getattr(state, name)), getattr(known, name), rtol=1e-6, atol=1e-7)
    assert failed > 0
    assert dead > 0


def test_any_number_of_pairs(there):
    start, step = np.random.default_rng(4).uniform(-1, 1, (6, 9)), np.full(6, 0.3)
    for memory in (1, 2, 7):
        known = LBFGS(memory=memory).run(bumpy(np, 1.0), start, step, 9)
        state = RingLBFGS(memory=memory, xp=there.xp).run(bumpy(there.xp, 1.0), there.put(start), there.put(step), 9)
        np.testing.assert_allclose(there.get(state.x), known.x, atol=1e-8, err_msg=str(memory))


def test_launches_waits_and_bytes_of_an_iteration(patterns):
    """Before the ring: 88 launches, a wait and .43 MB a row in the refinement, 96, a wait and .15 MB in the field."""
    counted, there = launches(), backend("torch")
    operators = FieldOperators.of(patterns, there, tolerance=5e-3, memory=4)
    batch = operators.batch(np.arange(ROWS), faintest=1e-12)
    function, descent = operators.phase_function(batch), operators.descent
    theta = there.put(np.random.default_rng(0).uniform(0, 6, (ROWS, 996)))
    state = descent.begin(function, theta, 1 / (operators.strongest * batch.gain[:, 0]) ** 2)
    descent.step(function, state)
    with counted:
        descent.step(function, state)
    assert counted.made.total() <= 65, counted.made
    assert counted.waits == 0
    assert counted.moved / ROWS <= 0.30e6
    of_function = launches()
    with of_function:
        function(state.x)
    assert of_function.made.total() <= 19, of_function.made
    field = operators.field_move(loudness=0.0075, floor=0.1, sampled=np.arange(0, 996, 4))
    fields = []
    for iterations in (4, 14):
        of_field = launches()
        with of_field:
            one = there.xp.ones_like(batch.gain[:, 0]) / operators.strongest
            field.run(batch, field.first(batch.p * operators.psi), one, iterations)
        fields.append(of_field)
    assert fields[1].made.total() - fields[0].made.total() <= 10 * 71
    assert fields[1].moved - fields[0].moved <= 10 * 0.12e6 * ROWS
    assert fields[1].waits == 0
