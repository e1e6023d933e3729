"""Settings of each mode."""

import pytest

from midair.model import Acoustics, Medium
from midair.settings import Settings, best_mode, finest_mode, paper_mode, quick_mode, with_fewer_points, with_paper_mode
from midair.solvers import Glide


def test_settings_of_the_modes():
    paper, best = paper_mode(), best_mode()
    assert paper == Settings()
    assert (paper.target.mapping, paper.target.rate) == ("half-wave", 1000.0)
    assert (paper.solver.level, paper.solver.amplitudes, paper.solver.guard) == (1.0, "equal", None)
    assert not paper.compensation.precompensate
    assert paper.acoustics.medium == Medium()
    assert best.acoustics.medium == Medium.at(temperature=22.0, humidity=0.5)
    assert (best.target.mapping, best.target.rate) == ("slow-bias", 4000.0)
    assert best.solver.guard is not None
    assert best.compensation.precompensate
    quick = quick_mode()
    assert isinstance(best.solver.method, Glide)
    assert isinstance(quick.solver.method, Glide)
    assert quick.solver.method.smooth < best.solver.method.smooth
    assert quick.but(method=best.solver.method) == best
    finest = finest_mode()
    assert finest.solver.quiet_palm
    assert finest.but(quiet_palm=0.0) == best


def test_a_coarser_grid_spans_the_same_square():
    rough = with_fewer_points(Settings(), 11).target.grid
    assert rough.x[[0, -1]] == pytest.approx(Settings().target.grid.x[[0, -1]])
    assert rough.count == 121


def test_modes_side_by_side_are_in_one_air():
    warm = paper_mode().but(acoustics=Acoustics(medium=Medium.at(temperature=25.0)))
    assert {settings.acoustics for settings in with_paper_mode("best", warm).values()} == {warm.acoustics}
    mine = best_mode()
    assert with_paper_mode("best", warm, mine)["best"] is mine
