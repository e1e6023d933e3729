from dataclasses import replace

import numpy as np
import pytest
from tests.solvers.terms.test_quiet_ears import ARRAY, GRID, target

from midair.model import Acoustics, ControlGrid, Palm
from midair.physics import propagate, transfer_matrix
from midair.settings import Settings
from midair.solvers import solve
from midair.solvers.terms.quiet_palm import QuietPalm


def around(grid):
    palm = Palm.disc(85e-3, pitch=1.5e-3)
    return palm.grid(grid.height).position[palm.beyond(22e-3, 22e-3).ravel()]


def test_rows_add_up_to_the_mean_square_over_the_palm_and_go_along_with_the_grid():
    term = QuietPalm(diameter=85e-3)
    rows, field = term.rows(GRID, ARRAY, Acoustics()), transfer_matrix(around(GRID), ARRAY)
    for q in np.exp(1j * np.random.default_rng(0).uniform(0, 2 * np.pi, (5, ARRAY.count))):
        assert (np.abs(rows @ q) ** 2).sum() == pytest.approx((np.abs(field @ q) ** 2).mean(), rel=0.1)
    moved = ControlGrid(rows=4, columns=4, pitch=11e-3, centre=(0.03, -0.01))
    there = QuietPalm().rows(moved, ARRAY, Acoustics())
    beside = replace(ARRAY, position=ARRAY.position - np.array([0.03, -0.01, 0.0]))
    np.testing.assert_allclose(there, QuietPalm().rows(GRID, beside, Acoustics()), atol=1e-9 * np.abs(there).max())


@pytest.mark.long
def test_the_palm_is_quieter_and_the_target_is_still_met():
    for method in ("fast", "lm", "glide"):
        loud, quiet = (solve(target(), ARRAY, method=method, quiet_palm=weight) for weight in (0.0, 0.1))
        before, after = (np.mean(np.abs(propagate(each.drive, around(GRID))) ** 2) for each in (loud, quiet))
        assert 10 * np.log10(after / before) < -6, method
        assert quiet.error.max() < loud.error.max() + 0.1, method
        assert quiet.drive.provenance.steps[-1].settings["quiet_palm"] == 0.1


HAND = Palm.within(np.array([[-30, -30], [80, -30], [80, 30], [-30, 30]]) * 1e-3)
"""To the right of the middle."""


def beside(x):
    """Points 60 to 80 mm beside the middle."""
    place = np.stack(np.meshgrid(x * np.linspace(60e-3, 80e-3, 9), np.linspace(-25e-3, 25e-3, 21)), axis=-1)
    return np.concatenate([place.reshape(-1, 2), np.full((place[..., 0].size, 1), GRID.height)], axis=1)


@pytest.mark.long
def test_a_hand_is_quiet_where_it_lies():
    drives = [
        solve(target(), ARRAY, method="fast", quiet_palm=term).drive
        for term in (QuietPalm(weight=0.3), QuietPalm.under(HAND, weight=0.3))
    ]
    right, left = ([np.mean(np.abs(propagate(each, beside(side))) ** 2) for each in drives] for side in (1.0, -1.0))
    # The disc of 100 mm does not include these points, nor the hand those on its other side.
    assert 10 * np.log10(right[1] / right[0]) < -6
    assert left[1] > 4 * right[1]
    assert drives[1].provenance.steps[-1].settings["quiet_palm_outline"] == HAND.rows


def test_a_hand_stays_where_it_is_and_its_margin_is_quiet_as_well():
    moved = ControlGrid(rows=4, columns=4, pitch=11e-3, centre=(0.03, 0.0))
    rows = [len(QuietPalm.under(HAND).rows(grid, ARRAY, Acoustics())) for grid in (GRID, moved)]
    # Both squares lie on it whole: as many of its points are left.
    assert rows[0] == pytest.approx(rows[1], rel=0.05)
    term = QuietPalm.under(HAND)
    area = (125 * 75 - 44**2) * 1e-6
    assert rows[0] * term.pitch**2 == pytest.approx(area, rel=0.1)


def test_settings_with_a_hand_can_be_written_down(tmp_path):
    made = Settings().but(quiet_palm=QuietPalm.under(HAND, weight=0.2))
    made.save(tmp_path / "hand.settings.toml")
    assert Settings.load(tmp_path / "hand.settings.toml") == made
    weaker = made.with_lines(["solver.quiet_palm.weight=0.1"])
    assert weaker.solver.quiet_palm == QuietPalm.under(HAND, weight=0.1)
