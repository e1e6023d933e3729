"""The batch solver and its parts on every installed array library: the same contract, the same results."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from midair.errors import InputError, MissingExtraError
from midair.solvers import Fast, Glide, Problem, SolverSettings, error_of, solver
from midair.solvers import backend as module
from midair.solvers.backend import LIBRARIES, Backend, backend
from midair.solvers.lbfgs import LBFGS
from midair.solvers.problem import CellTarget, GuardField

NEEDS = {"numpy": (), "strict": ("array_api_strict",), "torch": ("torch", "array_api_compat"), "cupy": ("cupy",)}


@pytest.fixture(params=list(LIBRARIES), ids=str)
def name(request):
    for needed in NEEDS[request.param]:
        pytest.importorskip(needed)
    return request.param


@pytest.fixture(params=["single", "double"], ids=str)
def there(request, name):
    return backend(name, precision=request.param)


def draw(*shape, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def host(array):
    return np.asarray(array)


def test_a_round_trip_to_the_backend_keeps_values(there):
    numbers = np.random.default_rng(0).normal(size=(3, 4))
    np.testing.assert_allclose(there.get(there.put(numbers)), numbers, atol=1e-7)
    assert there.get(there.put(numbers)).dtype == np.float64


def test_putting_an_array_copies_it(there):
    numbers = np.ones((2, 2), np.float32 if there.single else np.float64)
    put = there.put(numbers)
    put += 1
    np.testing.assert_array_equal(numbers, 1)


def test_phasors(there):
    theta = np.linspace(-7, 7, 12).reshape(3, 4)
    np.testing.assert_allclose(host(there.phasor(there.put(theta))), np.exp(1j * theta), atol=1e-6)


def test_complex_rows_as_real_ones_and_back(there):
    z = draw(3, 4)
    real = there.as_real(there.put(z))
    assert real.shape == (3, 8)
    np.testing.assert_allclose(host(there.as_complex(real)), z, atol=1e-6)
    np.testing.assert_allclose((host(real) ** 2).sum(axis=1), (np.abs(z) ** 2).sum(axis=1), rtol=1e-5)


def test_unit_of_nothing_is_one(there):
    q = np.array([[0, 2j, -3.0]])
    np.testing.assert_allclose(host(there.unit(there.put(q))), [[1, 1j, -1]], atol=1e-7)


def test_adjoint(there):
    z = draw(2, 3)
    np.testing.assert_allclose(host(there.adjoint(there.put(z))), z.conj().T, atol=1e-6)


def test_lbfgs_finds_minima_there(there):
    """Rows (x - a)^T diag(h) (x - a) / 2."""
    a, h = there.put(np.random.default_rng(0).normal(size=(3, 6))), there.put(np.geomspace(1, 30, 6))

    def function(x):
        slope = h * (x - a)
        return 0.5 * there.xp.vecdot(x - a, slope), slope

    start, step = there.xp.zeros_like(a), there.put(np.full(3, 0.03))
    found = LBFGS(memory=6, xp=there.xp).run(function, start, step, 40).x
    np.testing.assert_allclose(there.get(found), there.get(a), atol=1e-4)


def small(**rest):
    amplitude = np.random.default_rng(1).uniform(0.02, 0.2, (5, 8))
    amplitude[3] = 0
    return Problem(G=draw(8, 24) / 24, amplitude=amplitude, **rest)


GUARD = GuardField(G=draw(6, 24, seed=3) / 24, ceiling=0.5, weight=1.0)
WEIGHTS = np.kron(np.eye(2), np.full(4, 0.25))
TERMS = {
    "points": small(),
    "guard": small(guard=GUARD),
    "cells": small(cells=CellTarget(weights=WEIGHTS, wanted=small().amplitude ** 2 @ WEIGHTS.T)),
    "smooth": small(smooth=1e-2),
}


# Few iterations, before rounding can separate two descents; for the recording solver all kinds of frames.
FEW = {
    "fast": Fast(precision="double", field_iterations=8, iterations=4, more_iterations=4, batch=3),
    "glide, smooth": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=9.0, smooth=3, rows=3),
    "glide, bent": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=0.0, far=9.0, bent=(3, 2, 2), rows=3),
    "glide, rough": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=0.0, far=0.0, rough=(4, 2, 2), rows=3),
}


@pytest.mark.parametrize("few", list(FEW), ids=str)
def test_the_same_phases_as_numpy(name, few):
    """In double precision; glide keeps still by itself and has no such term."""
    few = FEW[few]
    for problem in TERMS:
        if problem == "smooth" and isinstance(few, Glide):
            continue
        expected = few.solve(TERMS[problem])
        answer = replace(few, backend=name).solve(TERMS[problem])
        np.testing.assert_allclose(np.exp(1j * answer.phase), np.exp(1j * expected.phase), atol=1e-6, err_msg=problem)
        assert answer.status == expected.status, problem
        np.testing.assert_array_equal(answer.iterations, expected.iterations, err_msg=problem)


def test_the_same_error_as_numpy_in_single_precision(name):
    problem = TERMS["points"]
    expected = error_of(problem, Fast().solve(problem).phase)
    np.testing.assert_allclose(error_of(problem, Fast(backend=name).solve(problem).phase), expected, atol=2e-3)


def test_a_gpu_gets_more_frames_at_once():
    assert backend("numpy").rows == 128
    assert Backend(xp=np, device="cuda:1").rows == 32768


def test_torch_gets_its_threads_back():
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    Fast(backend="torch", field_iterations=1, iterations=1).solve(small())
    assert torch.get_num_threads() == before


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("jax", "backend: expected one of numpy, torch"),
        ("numpy:cuda", "expected a device with torch only"),
        ("", "backend: expected one of numpy"),
    ],
)
def test_wrong_names_are_refused_with_the_valid_ones(wrong, message):
    with pytest.raises(InputError, match=message):
        backend(wrong)


def test_a_device_that_is_not_here_is_refused():
    torch = pytest.importorskip("torch")
    if torch.cuda.is_available():
        pytest.skip("there is a GPU here")
    with pytest.raises(InputError, match="expected an available device, got 'torch:cuda'"):
        backend("torch:cuda")
    with pytest.raises(InputError, match="expected an available device, got 'torch:nonsense'"):
        backend("torch:nonsense")


@pytest.mark.parametrize(("library", "extra"), [("torch", "gpu-torch"), ("cupy", "gpu-cupy")])
def test_a_missing_library_names_the_extra_to_install(monkeypatch, library, extra):
    monkeypatch.setitem(sys.modules, LIBRARIES[library], None)
    module._module.cache_clear()
    with pytest.raises(MissingExtraError, match=rf"pip install 'midair\[{extra}\]'"):
        backend(library)
    module._module.cache_clear()


def test_other_methods_have_no_backend():
    with pytest.raises(InputError, match="backend: expected method fast or glide, got lm"):
        solver("lm", backend="torch")
    assert solver("fast", backend="strict").backend == "strict"
    assert SolverSettings().backend is None
