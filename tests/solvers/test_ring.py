"""The ring makes the steps of `lbfgs` with a fixed number of launches and no synchronisation."""

from collections import Counter

import numpy as np
import pytest

from midair.solvers import Problem
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.lbfgs import LBFGS, RingLBFGS

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
