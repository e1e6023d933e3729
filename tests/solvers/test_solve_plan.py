"""Settings are checked before solving, and reach the solver; normalised units suit any array and any air."""

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers import Glide, automatic_level, solve
from midair.solvers.solve_plan import NormalisedSetup

SMALL = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
UNIT = TransducerArray.autd3(columns=1, rows=1)


def target(amplitude):
    return AmplitudeFrames(amplitude=np.asarray(amplitude, float), rate=500.0, grid=SMALL)


def wave(frames=4, points=16, pascal=3000.0):
    return pascal * np.random.default_rng(0).uniform(size=(frames, points))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "magic"}, "method: expected one of lm"),
        ({"start": "random"}, "start: expected previous or zero"),
        ({"level": 0.0}, "level: expected above 0"),
        ({"level": 1.5}, "level: expected above 0"),
        ({"bits": 0}, "bits: expected 1 to 16"),
        ({"iterations": 0}, "iterations: expected 1 or more"),
        ({"level": "loud"}, "level: expected a number, got 'loud'"),
        ({"amplitudes": "free"}, "amplitudes: expected one of equal, bounded, got 'free'"),
        ({"fit": "palm"}, "fit: expected one of points, windows, fine-windows, cells"),
        ({"smooth": -1.0}, "smooth: expected 0 or more"),
        ({"smooth": float("nan")}, "smooth: expected 0 or more"),
        ({"smooth": 0.1}, "method lm: expected supported terms .*, got smooth; choose fast"),
        ({"method": "free", "amplitudes": "bounded"}, "method free: .*, got amplitudes"),
        ({"backend": "torch"}, "backend: expected method fast or glide, got lm"),
    ],
)
def test_wrong_settings_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        solve(target(wave(1)), UNIT, **options)


@pytest.mark.parametrize("robust", [-1.0, 11.0, float("nan")])
def test_a_range_that_is_none_is_refused(robust):
    with pytest.raises(InputError, match="robust: expected 0 to 10 K"):
        solve(target(wave()), UNIT, robust=robust)


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


@pytest.mark.parametrize(("peak", "level"), [(0.05, 0.5), (0.1, 1.0), (3.0, 1.0), (1e-4, 0.05), (0.0, 0.05)])
def test_the_loudest_target_is_a_tenth_of_the_focus_at_the_level(peak, level):
    assert automatic_level(np.array([[0.0, peak / 2], [peak, 0.0]])) == pytest.approx(level)


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
