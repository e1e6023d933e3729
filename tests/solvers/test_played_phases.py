from dataclasses import replace
from itertools import product

import numpy as np
from tests.solvers.conftest import random_matrix

from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import quantise_phase
from midair.solvers import Fast, Problem, error_of, solve
from midair.solvers.backend import backend
from midair.solvers.problem import CellTarget, phases_and_errors


def problem(**rest):
    amplitude = np.random.default_rng(1).uniform(0.02, 0.2, (300, 8))
    amplitude[3] = 0
    return Problem(G=random_matrix(8, 24, 1), amplitude=amplitude, **rest)


WEIGHTS = np.kron(np.eye(2), np.full(4, 0.25))
CELLS = CellTarget(weights=WEIGHTS, wanted=problem().amplitude ** 2 @ WEIGHTS.T)


def test_phases_and_errors_are_those_of_the_host(library):
    """More frames than a batch has."""
    rng = np.random.default_rng(2)
    theta = rng.uniform(-20, 20, (300, 24))
    problems = {"full": problem(), "level": problem(level=0.7), "cells": problem(cells=CELLS)}
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
