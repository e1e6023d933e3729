"""Settings are checked before solving, and reach the solver; normalised units suit any array and any air."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import middle_of, palm_matrix, transfer_matrix
from midair.solvers import Glide, automatic_level, solve
from midair.solvers.solve_plan import NormalisedSetup

SMALL = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
UNIT = TransducerArray.autd3(columns=1, rows=1)


def target(amplitude):
    return AmplitudeFrames(amplitude=np.asarray(amplitude, float), rate=500.0, grid=SMALL)


def wave(frames=4, points=16, pascal=3000.0):
    return pascal * np.random.default_rng(0).uniform(size=(frames, points))


def test_methods_get_the_positions_of_the_transducers(monkeypatch):
    """Glide samples transducers evenly over the array; without positions it would take every fourth by index."""
    seen = []
    solve_as_it_is = Glide.solve

    def solve_and_look(self, problem, **rest):
        seen.append(problem.position)
        return solve_as_it_is(self, problem, **rest)

    monkeypatch.setattr(Glide, "solve", solve_and_look)
    solve(target(wave()), UNIT, method="glide")
    np.testing.assert_array_equal(seen[0], UNIT.position)


def test_the_loudest_target_is_a_tenth_of_the_focus_at_the_level():
    levels = {0.05: 0.5, 0.1: 1.0, 3.0: 1.0, 1e-4: 0.05, 0.0: 0.05}
    assert {peak: automatic_level(np.array([[0.0, peak / 2], [peak, 0.0]])) for peak in levels} == pytest.approx(levels)


NINE = ControlGrid(rows=3, columns=3, pitch=11e-3, height=0.1)


def scene(*airs):
    amplitude = 1000.0 * np.random.default_rng(0).uniform(size=(4, 9))
    return NormalisedSetup.of(AmplitudeFrames(amplitude=amplitude, rate=500.0, grid=NINE), UNIT, airs or (Acoustics(),))


def test_airs_stand_below_each_other_in_the_units_of_the_first():
    warm = Acoustics(medium=Medium.at(temperature=30.0))
    made = scene(Acoustics(), warm)
    problem = made.problem(1.0)
    assert problem.G.shape == (18, UNIT.count)
    assert problem.amplitude.shape == (4, 18)
    np.testing.assert_allclose(made.focus * problem.G[9:], transfer_matrix(NINE, UNIT, acoustics=warm))
    np.testing.assert_array_equal(problem.amplitude[:, :9], problem.amplitude[:, 9:])


def test_matrices_are_computed_once_for_an_array_that_is_the_same_by_its_numbers(monkeypatch):
    computed, module = [], "midair.solvers.solve_plan.palm_matrix"
    monkeypatch.setattr(module, lambda *where, **how: computed.append(how) or palm_matrix(*where, **how))
    grid, unit = replace(SMALL, height=0.123), TransducerArray.autd3(columns=1, rows=1)
    mirror, silent = replace(unit, reflection=0.5j), replace(unit, response=np.linspace(0, 1, unit.count))
    for array in (unit, mirror, silent, replace(unit, name="again"), replace(mirror, unit=mirror.unit)):
        made = NormalisedSetup.of(replace(target(wave()), grid=grid), array, (Acoustics(),))
        how = {"reflection": array.reflection, "middle": middle_of(grid), "acoustics": Acoustics()}
        np.testing.assert_allclose(made.focus * made.G[0], palm_matrix(grid.position, array, **how))
        assert made.array is array
    assert len(computed) == 3
