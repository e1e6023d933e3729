import sys
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers import METHODS, TERMS, PhaseTerm, registered_terms, settings_type, solve

UNIT = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=4, columns=4, pitch=11e-3, height=0.1)
WAVE = 600 * np.random.default_rng(0).uniform(size=(5, GRID.count))


@dataclass(frozen=True, slots=True, kw_only=True)
class StillPhase(PhaseTerm):
    """Penalty on the distance of every phase from 0: weight mean_n (1 - cos theta_n)."""

    keyword = "still_phase"
    help = "Penalty on phases other than 0; 1 is strong."

    weight: float

    def cost(self, xp, q, before):
        return self.weight * (1 - xp.mean(xp.real(q), axis=1)), self.weight / q.shape[1] * xp.imag(q)


@pytest.fixture
def still_phase(monkeypatch):
    """The term of this file, registered."""
    monkeypatch.setitem(TERMS, "still_phase", f"{__name__}:StillPhase")
    monkeypatch.setitem(sys.modules, __name__, sys.modules.get(__name__) or SimpleNamespace(StillPhase=StillPhase))
    forget()
    yield
    monkeypatch.undo()
    forget()


def forget():
    registered_terms.cache_clear()
    settings_type.cache_clear()


def target(amplitude):
    return AmplitudeFrames(amplitude=np.asarray(amplitude, float), rate=1000.0, grid=GRID)


def test_every_term_has_a_setting_an_option_and_methods():
    # `midair.settings` imports all terms, so that the module of a term cannot import it.
    from midair.settings import CHOICES, Settings

    options = {choice.name: choice for choice in CHOICES}
    for keyword, term in registered_terms().items():
        assert term.keyword == keyword
        assert options[term.option()].help == term.help
        assert getattr(Settings().solver, keyword) == term.default
        assert term.of(term.default) is None
        assert term.methods <= set(METHODS)
    for keyword in ("quiet_ears", "quiet_palm"):
        typed = options[keyword.replace("_", "-")].put(Settings(), 0.1)
        assert typed == Settings().but(**{keyword: 0.1}) == Settings.from_plain(typed.plain())
        assert getattr(typed.solver, keyword) == 0.1


@pytest.mark.usefixtures("still_phase")
def test_a_registered_term_is_solved_with_and_noted():
    plain, still = (solve(target(WAVE), UNIT, method="fast", still_phase=weight).drive for weight in (0.0, 1.0))
    before, after = (np.mean(1 - np.cos(each.phase)) for each in (plain, still))
    assert after < 0.5 * before
    assert still.provenance.steps[-1].settings["still_phase"] == 1.0
    with pytest.raises(InputError, match=r"method lm: expected supported terms .* got still-phase; choose fast"):
        solve(target(WAVE), UNIT, still_phase=1.0)
    with pytest.raises(InputError, match="still_phase: expected 0 or more, got -1"):
        solve(target(WAVE), UNIT, method="fast", still_phase=-1.0)
