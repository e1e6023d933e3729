"""The batch solver and its parts on every installed array library: the same contract, the same results."""

import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from midair.errors import InputError, MissingExtraError
from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import quantise_phase
from midair.solvers import Fast, Glide, Problem, SolverSettings, error_of, solve, solver
from midair.solvers import backend as module
from midair.solvers.backend import LIBRARIES, backend
from midair.solvers.problem import CellTarget, GuardField, phases_and_errors


def draw(*shape, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def host(array):
    return np.asarray(array)


def test_numbers_go_there_and_back(library, subtests):
    numbers, z = np.random.default_rng(0).uniform(-7, 7, (3, 4)), draw(3, 4)
    for precision in ("single", "double"):
        with subtests.test(precision=precision):
            there = backend(library, precision=precision)
            put = there.put(numbers)
            np.testing.assert_allclose(there.get(put), numbers, atol=1e-6)
            assert there.get(put).dtype == np.float64
            np.testing.assert_allclose(host(there.phasor(put)), np.exp(1j * numbers), atol=1e-6)
            put += 1
            np.testing.assert_allclose(there.get(put), numbers + 1, atol=1e-6)
            real = there.as_real(there.put(z))
            assert real.shape == (3, 8)
            np.testing.assert_allclose(host(there.as_complex(real)), z, atol=1e-6)
            np.testing.assert_allclose(host(there.adjoint(there.put(z))), z.conj().T, atol=1e-6)
            np.testing.assert_allclose(host(there.angle(there.put(z))), np.angle(z), atol=1e-6)
            of_zero = host(there.unit(there.put(np.array([[0, 2j, -3.0]]))))
            np.testing.assert_allclose(of_zero, [[1, 1j, -1]], atol=1e-7)


AMPLITUDE = np.random.default_rng(1).uniform(0.02, 0.2, (5, 8)) * (np.arange(5) != 3)[:, None]


def small(amplitude=AMPLITUDE, **rest):
    return Problem(G=draw(8, 24) / 24, amplitude=amplitude, **rest)


GUARD = GuardField(G=draw(6, 24, seed=3) / 24, ceiling=0.5, weight=1.0)
WEIGHTS = np.kron(np.eye(2), np.full(4, 0.25))
TERMS = {
    "points": small(),
    "guard": small(guard=GUARD),
    "cells": small(cells=CellTarget(weights=WEIGHTS, wanted=AMPLITUDE**2 @ WEIGHTS.T)),
    "smooth": small(smooth=1e-2),
}


# Few iterations, before rounding can separate two descents; for the recording solver all kinds of frames.
FEW = {
    "fast": Fast(precision="double", field_iterations=8, iterations=4, more_iterations=4, batch=3),
    "glide, smooth": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=9.0, smooth=3, rows=3),
    "glide, bent": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=0.0, far=9.0, bent=(3, 2, 2), rows=3),
    "glide, rough": Glide(precision="double", cold=(8, 2, 4), coarse=4, near=0.0, far=0.0, rough=(4, 2, 2), rows=3),
}


def test_the_same_phases_as_numpy(library, subtests):
    """In double precision; glide keeps still by itself and has no such term."""
    for name, few in FEW.items():
        for term, problem in TERMS.items():
            if term == "smooth" and isinstance(few, Glide):
                continue
            with subtests.test(method=name, term=term):
                expected, answer = few.solve(problem), replace(few, backend=library).solve(problem)
                np.testing.assert_allclose(np.exp(1j * answer.phase), np.exp(1j * expected.phase), atol=1e-6)
                assert answer.status == expected.status
                np.testing.assert_array_equal(answer.iterations, expected.iterations)


def test_the_same_error_as_numpy_in_single_precision(library):
    problem, few = TERMS["points"], Fast(field_iterations=20, iterations=20, more_iterations=20)
    expected, found = (error_of(problem, each.solve(problem).phase) for each in (few, replace(few, backend=library)))
    np.testing.assert_allclose(found, expected, atol=2e-3)


def test_torch_gets_its_threads_back():
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    Fast(backend="torch", field_iterations=1, iterations=1).solve(small())
    assert torch.get_num_threads() == before


def test_a_device_that_is_not_here_is_refused():
    torch = pytest.importorskip("torch")
    if torch.cuda.is_available():
        pytest.skip("there is a GPU here")
    for device in ("torch:cuda", "torch:nonsense"):
        with pytest.raises(InputError, match=f"expected an available device, got '{device}'"):
            backend(device)


def test_a_missing_library_names_the_extra_to_install_and_none_is_the_rule(monkeypatch):
    for library, extra in (("torch", "gpu-torch"), ("cupy", "gpu-cupy")):
        monkeypatch.setitem(sys.modules, LIBRARIES[library], None)
        module._module.cache_clear()
        with pytest.raises(MissingExtraError, match=rf"pip install 'midair\[{extra}\]'"):
            backend(library)
        module._module.cache_clear()
    assert solver("fast", backend="strict").backend == "strict"
    assert SolverSettings().backend is None


def test_phases_and_errors_are_those_of_the_host(library):
    """More frames than a batch has."""
    rng = np.random.default_rng(2)
    theta = rng.uniform(-20, 20, (300, 24))
    amplitude = np.tile(AMPLITUDE, (60, 1))
    cells = CellTarget(weights=WEIGHTS, wanted=amplitude**2 @ WEIGHTS.T)
    problems = {"full": small(amplitude), "level": small(amplitude, level=0.7), "cells": small(amplitude, cells=cells)}
    for (which, asked), level, bits in product(problems.items(), (None, (300,), (300, 24)), (None, 8)):
        part = None if level is None else rng.uniform(0, 1, level)
        phase, error = phases_and_errors(backend(library, precision="double"), asked, theta, part, bits)
        expected = np.mod(theta, 2 * np.pi) if bits is None else quantise_phase(theta, bits=bits)
        case = f"{which}, level {level}, {bits} bits"
        np.testing.assert_allclose(phase, expected, atol=1e-12, err_msg=case)
        np.testing.assert_allclose(error, error_of(asked, expected, part), rtol=1e-9, err_msg=case)
        assert error[3] == 0, case


def test_solve_reports_the_error_of_the_played_phases(library):
    """End to end: the error of the drive's propagated field equals the reported error."""
    grid, array = ControlGrid(rows=3, columns=3, pitch=0.01), TransducerArray.autd3(columns=1, rows=1)
    target = AmplitudeFrames(amplitude=np.random.default_rng(5).uniform(20, 60, (6, 9)), rate=1000.0, grid=grid)
    few = Fast(field_iterations=4, iterations=4, more_iterations=2)
    for amplitudes in ("equal", "bounded"):
        found, expected = (
            solve(target, array, method=each, amplitudes=amplitudes, bits=8)
            for each in (replace(few, backend=library), few)
        )
        np.testing.assert_allclose(found.error, expected.error, atol=2e-2, err_msg=amplitudes)
        steps = found.drive.phase * 256 / (2 * np.pi)
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9, err_msg=amplitudes)
