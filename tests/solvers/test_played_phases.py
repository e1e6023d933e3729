from itertools import product

import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import quantise_phase
from midair.solvers import Fast, Problem, error_of, solve
from midair.solvers.backend import backend
from midair.solvers.problem import CellTarget, phases_and_errors


@pytest.fixture(params=["numpy", "strict", "torch", "cupy"])
def name(request):
    pytest.importorskip({"numpy": "numpy", "strict": "array_api_strict"}.get(request.param, request.param))
    return request.param


def problem(**rest):
    rng = np.random.default_rng(1)
    amplitude = rng.uniform(0.02, 0.2, (300, 8))
    amplitude[3] = 0
    return Problem(G=(rng.normal(size=(8, 24)) + 1j * rng.normal(size=(8, 24))) / 24, amplitude=amplitude, **rest)


WEIGHTS = np.kron(np.eye(2), np.full(4, 0.25))
CELLS = CellTarget(weights=WEIGHTS, wanted=problem().amplitude ** 2 @ WEIGHTS.T)


def test_phases_and_errors_are_those_of_the_host(name):
    """More frames than a batch has."""
    rng = np.random.default_rng(2)
    theta = rng.uniform(-20, 20, (300, 24))
    problems = {"full": problem(), "level": problem(level=0.7), "cells": problem(cells=CELLS)}
    for (which, asked), level, bits in product(problems.items(), (None, (300,), (300, 24)), (None, 8)):
        part = None if level is None else rng.uniform(0, 1, level)
        phase, error = phases_and_errors(backend(name, precision="double"), asked, theta, part, bits)
        expected = np.mod(theta, 2 * np.pi) if bits is None else quantise_phase(theta, bits=bits)
        case = f"{which}, level {level}, {bits} bits"
        np.testing.assert_allclose(phase, expected, atol=1e-12, err_msg=case)
        np.testing.assert_allclose(error, error_of(asked, expected, part), rtol=1e-9, err_msg=case)
        assert error[3] == 0, case


@pytest.mark.parametrize("amplitudes", ["equal", "bounded"])
def test_solve_reports_the_error_of_the_played_phases(name, amplitudes):
    """End to end: the error of the drive's propagated field equals the reported error."""
    grid, array = ControlGrid(rows=3, columns=3, pitch=0.01), TransducerArray.autd3(columns=1, rows=1)
    target = AmplitudeFrames(amplitude=np.random.default_rng(5).uniform(20, 60, (6, 9)), rate=1000.0, grid=grid)
    few = Fast(backend=name, field_iterations=4, iterations=4, more_iterations=2)
    here = Fast(field_iterations=4, iterations=4, more_iterations=2)
    found = solve(target, array, method=few, amplitudes=amplitudes, bits=8)
    expected = solve(target, array, method=here, amplitudes=amplitudes, bits=8)
    np.testing.assert_allclose(found.error, expected.error, atol=2e-2)
    step = 2 * np.pi / 256
    np.testing.assert_allclose(found.drive.phase / step, np.rint(found.drive.phase / step), atol=1e-9)
