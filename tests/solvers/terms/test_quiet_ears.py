import numpy as np
import pytest

from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Medium, TransducerArray
from midair.physics import focus_amplitude, propagate, transfer_matrix
from midair.solvers import solve
from midair.solvers.problem import GuardField
from midair.solvers.terms.quiet_ears import QuietEars

ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=4, columns=4, pitch=11e-3)


def somewhere_at_the_ears(count, rng):
    ears = np.reshape(QuietEars().positions, (-1, 3))
    return np.concatenate([ear + rng.uniform(-0.04, 0.04, (count, 3)) for ear in ears])


def target():
    amplitude = np.zeros((2, GRID.count))
    amplitude[0, [0, 5]], amplitude[1, [3, 9]] = 1.0, 0.7
    return AmplitudeFrames(amplitude=0.2 * focus_amplitude(GRID, ARRAY) * amplitude, rate=1000.0, grid=GRID)


def test_rows_add_up_to_the_mean_square_over_the_cubes():
    """Against 4000 random points in the cubes, for random drives and for one focused on an ear."""
    rng = np.random.default_rng(0)
    rows = QuietEars().rows(ControlGrid(), ARRAY, Acoustics())
    field = transfer_matrix(somewhere_at_the_ears(2000, rng), ARRAY)
    for q in np.exp(1j * rng.uniform(0, 2 * np.pi, (5, ARRAY.count))):
        assert (np.abs(rows @ q) ** 2).sum() == pytest.approx((np.abs(field @ q) ** 2).mean(), rel=0.1)
    assert len(rows) < ARRAY.count / 2


@pytest.mark.long
def test_rows_of_a_range_of_temperatures_are_the_mean_over_its_airs():
    rng = np.random.default_rng(4)
    rows = QuietEars(temperatures=(14.0, 30.0)).rows(GRID, ARRAY, Acoustics())
    points = somewhere_at_the_ears(500, rng)
    for q in np.exp(1j * rng.uniform(0, 2 * np.pi, (3, ARRAY.count))):
        # Dry air attenuates least.
        airs = [Acoustics(medium=Medium.at(temperature=each, humidity=0.1)) for each in (14, 18, 22, 26, 30)]
        power = [np.abs(transfer_matrix(points, ARRAY, acoustics=air) @ q) ** 2 for air in airs]
        assert (np.abs(rows @ q) ** 2).sum() == pytest.approx(np.mean(power), rel=0.15)


def test_ears_are_quieter_and_the_target_is_still_met():
    points = somewhere_at_the_ears(200, np.random.default_rng(1))
    for method in ("fast", "lm", "glide", "free"):
        loud, quiet = (solve(target(), ARRAY, method=method, quiet_ears=weight) for weight in (0.0, 10.0))
        before, after = (np.mean(np.abs(propagate(each.drive, points)) ** 2) for each in (loud, quiet))
        assert 10 * np.log10(after / before) < -6, method
        assert quiet.error.max() < loud.error.max() + 0.15, method
        assert quiet.drive.provenance.steps[-1].settings["quiet_ears"] == 10.0


def test_beside_a_guard_each_keeps_its_weight():
    rng = np.random.default_rng(2)
    G, rows = (rng.normal(size=(n, 3)) + 1j * rng.normal(size=(n, 3)) for n in (4, 2))
    both = GuardField(G=G, ceiling=0.3, weight=2.0).and_quiet(rows, 8.0)
    assert both.weight == 2.0
    np.testing.assert_array_equal(both.ceilings, [0.3] * 4 + [0.0] * 2)
    np.testing.assert_allclose(both.weight * np.abs(both.G[4:]) ** 2, 8.0 * np.abs(rows) ** 2)
