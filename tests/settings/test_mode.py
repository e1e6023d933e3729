"""What each mode stands for."""

import pytest

from midair.model import Medium
from midair.settings import Settings, best_mode, coarser, paper_mode, quick_mode
from midair.solvers import Fast


def test_the_modes_are_what_they_say():
    paper, best = paper_mode(), best_mode()
    assert paper == Settings()
    assert (paper.target.mapping, paper.target.rate) == ("half-wave", 1000.0)
    assert (paper.solver.level, paper.solver.amplitudes, paper.solver.guard) == (1.0, "equal", None)
    assert not paper.compensation.precompensate
    assert paper.acoustics.medium == Medium()
    assert (best.target.mapping, best.target.rate) == ("slow-bias", 4000.0)
    assert best.solver.guard is not None
    assert best.compensation.precompensate
    assert quick_mode().but(iterations=None) == best
    assert Fast().iterations > quick_mode().solver.iterations


def test_a_coarser_grid_spans_the_same_square():
    rough = coarser(Settings(), 11).target.grid
    assert rough.x[[0, -1]] == pytest.approx(Settings().target.grid.x[[0, -1]])
    assert rough.count == 121
