"""Products folded by the mirrors of the array, compiled loops, and the solutions that they give."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.settings import best_mode
from midair.solvers import backend as backend_module
from midair.solvers.backend import backend
from midair.solvers.mirror_symmetry import KINDS, Lattice, Product, modes_by_kind
from midair.solvers.solve_plan import SolvePlan

ARRAY, GRID = TransducerArray.autd3(), ControlGrid()
RNG = np.random.default_rng(5)
UNLIKE = replace(ARRAY, response=RNG.uniform(0.7, 1.2, ARRAY.count) * np.exp(1j * RNG.uniform(-1, 1, ARRAY.count)))


def rows(*shape):
    return np.asarray(RNG.normal(size=shape) + 1j * RNG.normal(size=shape))


@pytest.fixture(scope="module", params=["alike", "measured"])
def folded(request):
    """A lattice, V by kind, and the dense matrix diag(weight) W that it stands for, (mode, place)."""
    lattice = Lattice.of(ARRAY if request.param == "alike" else UNLIKE)
    G = transfer_matrix(GRID, lattice.array) / focus_amplitude(GRID, ARRAY)
    _, V = modes_by_kind(G, 5e-3)
    dense = np.einsum("ki,kmn->kmin", KINDS, V).reshape(V.shape[0] * V.shape[1], -1)
    return lattice, V, lattice.weight * dense


@pytest.fixture(params=["double", "single", "single, no Numba"])
def own_backend(request, monkeypatch):
    monkeypatch.setattr(backend_module, "_kernel", lambda: None) if "no" in request.param else None
    return backend("numpy", precision=request.param.partition(",")[0])


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_products_by_kind_are_those_of_the_whole_matrix(folded, own_backend):
    lattice, V, dense = folded
    product = Product.of(own_backend, V, lattice.weight)
    put = own_backend.put
    b, q, theta = rows(3, len(dense)), rows(3, dense.shape[1]), RNG.uniform(-3, 3, (3, dense.shape[1]))
    close(product.of_modes(put(b)), b @ dense)
    close(product.to_modes(put(q)), q @ dense.conj().T)
    held, a = product.phasors(put(theta))
    close(a, np.exp(1j * theta) @ dense.conj().T)
    close(product.turning(held, put(b)), np.imag(np.exp(-1j * theta) * (b @ dense)))
    factor = RNG.uniform(1, 2, len(dense))
    some = np.array([3, 8, 100])
    close(product.scaled(put(factor)).of_modes(put(b)), (factor * b) @ dense)
    every = (np.arange(4)[:, None] * V.shape[2] + some).reshape(-1)
    close(product.columns(some).of_modes(put(b)), b @ dense[:, every])


def test_the_phases_follow_a_field_by_kind_as_by_the_whole_matrix(folded, own_backend):
    lattice, V, dense = folded
    whole = Product.of(own_backend, dense)
    product, put = Product.of(own_backend, V, lattice.weight), own_backend.put
    q = put(np.exp(1j * RNG.uniform(-3, 3, (2, dense.shape[1]))))
    a = put(20 * rows(2, len(dense)) / len(dense))
    found, expected = (each.fitted(a, q, 5, step=2.0, momentum=0.3) for each in (product, whole))
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_a_lattice_has_the_fields_of_its_array():
    lattice, theta = Lattice.of(UNLIKE), RNG.uniform(-3, 3, (2, 1008))
    G, air = transfer_matrix(GRID, lattice.array), Acoustics()
    field = np.exp(1j * lattice.phase(theta)) @ transfer_matrix(GRID, UNLIKE, acoustics=air).T
    close((lattice.weight * np.exp(1j * theta)) @ G.T, field)


def wave(frames):
    """A spot that moves and swings, at a strength of .15."""
    time, at = np.arange(frames)[:, None] / 400, GRID.position
    x = 0.01 * np.sin(2 * np.pi * time)
    spot = np.exp(-((at[:, 0] - x) ** 2 + at[:, 1] ** 2) / (2 * 0.009**2)) * (0.6 + 0.4 * np.sin(25 * time))
    return AmplitudeFrames(amplitude=0.15 * focus_amplitude(GRID, ARRAY) * spot, rate=4000.0, grid=GRID)


@pytest.mark.parametrize("array", [ARRAY, UNLIKE], ids=["alike", "measured"])
def test_the_error_is_that_of_the_array_as_a_whole(array):
    """Sequences differ by some per cent in either direction, their mean by less; see docs/decisions/0048-folding.md."""
    target = wave(200)
    plan = SolvePlan.of(target, array, best_mode().solver)
    assert plan.scene.lattice is not None
    folded, whole = (each.solve(target, None, None)[0].error for each in (plan, replace(plan, scene=plan.own)))
    assert folded.mean() < 1.1 * whole.mean()
    assert folded.max() < 1.3 * whole.max()


def test_compiled_loops_make_the_steps_of_numpy(monkeypatch):
    pytest.importorskip("numba")
    plan = SolvePlan.of(wave(6), ARRAY, best_mode().solver)
    compiled = plan.solve(wave(6), None, None)[0]
    monkeypatch.setattr(backend_module, "_kernel", lambda: None)
    plain = plan.solve(wave(6), None, None)[0]
    np.testing.assert_allclose(compiled.error, plain.error, rtol=0.03)


def test_points_far_from_the_middle_are_not_folded():
    lattice = Lattice.of(ARRAY)
    far = replace(GRID, centre=(0.03, 0.0))
    assert modes_by_kind(transfer_matrix(far, lattice.array), 5e-3) is None
