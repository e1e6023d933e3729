import numpy as np
import pytest

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Palm, TransducerArray
from midair.physics import focus_amplitude, propagate, transfer_matrix
from midair.settings import CHOICES, Settings
from midair.solvers import solve
from midair.solvers.terms import QuietPalm

ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=4, columns=4, pitch=11e-3)


def around(grid):
    palm = Palm.disc(85e-3, pitch=1.5e-3)
    return palm.grid(grid.height).position[palm.beyond(22e-3, 22e-3).ravel()]


def target():
    amplitude = np.zeros((2, GRID.count))
    amplitude[0, [0, 5]], amplitude[1, [3, 9]] = 1.0, 0.7
    return AmplitudeFrames(amplitude=0.2 * focus_amplitude(GRID, ARRAY) * amplitude, rate=1000.0, grid=GRID)


def test_rows_add_up_to_the_mean_square_over_the_palm():
    term = QuietPalm(diameter=85e-3)
    rows, field = term.rows(GRID, ARRAY, Acoustics()), transfer_matrix(around(GRID), ARRAY)
    for q in np.exp(1j * np.random.default_rng(0).uniform(0, 2 * np.pi, (5, ARRAY.count))):
        assert (np.abs(rows @ q) ** 2).sum() == pytest.approx((np.abs(field @ q) ** 2).mean(), rel=0.1)


@pytest.mark.parametrize("method", ["fast", "lm", "glide"])
def test_the_palm_is_quieter_and_the_target_is_still_met(method):
    loud, quiet = (solve(target(), ARRAY, method=method, quiet_palm=weight) for weight in (0.0, 0.1))
    before, after = (np.mean(np.abs(propagate(each.drive, around(GRID))) ** 2) for each in (loud, quiet))
    assert 10 * np.log10(after / before) < -6
    assert quiet.error.max() < loud.error.max() + 0.1
    assert quiet.drive.provenance.steps[-1].settings["quiet_palm"] == 0.1


def test_it_goes_along_with_a_grid_that_is_elsewhere():
    moved = ControlGrid(rows=4, columns=4, pitch=11e-3, centre=(0.03, -0.01))
    there = QuietPalm().rows(moved, ARRAY, Acoustics())
    beside = TransducerArray(**{**_parts(ARRAY), "position": ARRAY.position - np.array([0.03, -0.01, 0.0])})
    np.testing.assert_allclose(there, QuietPalm().rows(GRID, beside, Acoustics()), atol=1e-9 * np.abs(there).max())


def _parts(array):
    return {name: getattr(array, name) for name in array.__dataclass_fields__}


@pytest.mark.parametrize(
    ("method", "asked", "says"),
    [
        ("exact", 0.1, "quiet-palm"),
        ("fast", -0.1, "0 or more, got -0.1"),
        ("fast", QuietPalm(diameter=40e-3), "a disc larger than the control points, got one of 40 mm"),
    ],
)
def test_what_cannot_be_is_refused(method, asked, says):
    with pytest.raises(InputError, match=says):
        solve(target(), ARRAY, method=method, quiet_palm=asked)


def test_it_can_be_typed():
    (choice,) = [each for each in CHOICES if each.name == "quiet-palm"]
    assert choice.put(Settings(), 0.1).solver.quiet_palm == 0.1
    assert Settings.from_plain(Settings().but(quiet_palm=0.1).plain()).solver.quiet_palm == 0.1
