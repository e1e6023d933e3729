import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from midair.errors import InputError
from midair.files import load_solution
from midair.model import AmplitudeFrames, ControlGrid, TransducerArray
from midair.solvers import METHODS, TERMS, PhaseTerm, registered_terms, settings_type, solve

ROOT = Path(__file__).parents[3]
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledTerm(StillPhase):
    keyword = "compiled_term"
    methods = frozenset({"live"})


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Register terms of this file as an installed package; returns its folder."""

    def install(*kinds):
        folder = tmp_path / "other_terms-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: other-terms\nVersion: 1.0\n")
        rows = [f"{kind.keyword} = tests.solvers.terms.test_term:{kind.__name__}" for kind in kinds]
        (folder / "entry_points.txt").write_text("[midair.terms]\n" + "\n".join(rows))
        monkeypatch.syspath_prepend(ROOT)
        monkeypatch.syspath_prepend(tmp_path)
        forget()
        return tmp_path

    yield install
    monkeypatch.undo()
    forget()


def forget():
    TERMS.__dict__.pop("_others", None)
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


def test_a_term_of_another_package_is_solved_with_and_noted(register):
    register(StillPhase)
    plain, still = (solve(target(WAVE), UNIT, method="fast", still_phase=weight).drive for weight in (0.0, 1.0))
    before, after = (np.mean(1 - np.cos(each.phase)) for each in (plain, still))
    assert after < 0.5 * before
    assert still.provenance.steps[-1].settings["still_phase"] == 1.0
    with pytest.raises(InputError, match=r"method lm: expected supported terms .* got still-phase; choose fast"):
        solve(target(WAVE), UNIT, still_phase=1.0)
    with pytest.raises(InputError, match="still_phase: expected 0 or more, got -1"):
        solve(target(WAVE), UNIT, method="fast", still_phase=-1.0)


def test_a_term_that_no_method_can_use_is_left_out(register):
    register(CompiledTerm)
    with pytest.warns(UserWarning, match="compiled_term: expected a subclass of QuietTerm .* for live;"):
        assert "compiled_term" not in registered_terms()


@pytest.mark.long
def test_a_term_of_another_package_is_an_option(register, tmp_path):
    paths = [str(register(StillPhase)), str(ROOT), str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "100"}

    def midair(*words):
        command = [sys.executable, "-m", "midair", *words]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True, timeout=300
        ).stdout

    told = " ".join(midair("solve", "--help").split())
    assert "--still-phase" in told
    assert "Penalty on phases other than 0" in told
    midair("record", "virtual:am-i", "am.h5", "--duration", "0.1s")
    small = "--mode paper --points 6 --pitch 11mm --method fast --iterations 2 2 --duration 10ms --lead 0s"
    midair("solve", "am.h5", "am.drive.h5", *small.split(), "--still-phase", "0.5")
    steps = {step.stage: step.settings for step in load_solution(tmp_path / "am.drive.h5").drive.provenance.steps}
    assert steps["solve"]["still_phase"] == 0.5
    assert steps["settings"]["solver.still_phase"] == 0.5
