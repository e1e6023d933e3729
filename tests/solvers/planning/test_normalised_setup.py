"""Normalised units: the same numbers for any array and any air."""

import numpy as np
import pytest

from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers.planning.normalised_setup import NormalisedSetup

GRID = ControlGrid(rows=3, columns=3, pitch=11e-3, height=0.1)
UNIT = TransducerArray.autd3(columns=1, rows=1)


def scene(*airs):
    amplitude = 1000.0 * np.random.default_rng(0).uniform(size=(4, 9))
    return NormalisedSetup.of(AmplitudeFrames(amplitude=amplitude, rate=500.0, grid=GRID), UNIT, airs or (Acoustics(),))


def test_one_is_the_strongest_focus():
    made = scene()
    assert made.focus == pytest.approx(focus_amplitude(GRID, UNIT, acoustics=Acoustics()))
    assert np.abs(made.G[0]).sum(axis=1).max() == pytest.approx(1)
    np.testing.assert_allclose(made.focus * made.G[0], transfer_matrix(GRID, UNIT, acoustics=Acoustics()))


def test_airs_stand_below_each_other_in_the_units_of_the_first():
    warm = Acoustics(medium=Medium.at(temperature=30.0))
    made = scene(Acoustics(), warm)
    problem = made.problem(1.0, None, None, 0.0, None, None)
    assert problem.G.shape == (18, UNIT.count)
    assert problem.amplitude.shape == (4, 18)
    np.testing.assert_allclose(made.focus * problem.G[9:], transfer_matrix(GRID, UNIT, acoustics=warm))
    np.testing.assert_array_equal(problem.amplitude[:, :9], problem.amplitude[:, 9:])
