"""Settings as one value: changed by name, saved and loaded."""

from dataclasses import replace

import pytest

from midair.errors import BrokenFileError, InputError
from midair.model import Acoustics, ControlGrid, Medium, Provenance
from midair.settings import (
    Settings,
    best_mode,
    finest_mode,
    paper_mode,
    quick_mode,
    quiet_mode,
    with_fewer_points,
    with_paper_mode,
)
from midair.solvers import Cells, Fast, LevenbergMarquardt, Windows
from midair.targets import Circle


def test_but_finds_each_setting_in_its_group():
    made = Settings().but(rate=4000.0, gain=2.0, band=(30.0, 300.0), method="fast", decouple=True)
    assert (made.target.rate, made.target.gain, made.calibration.band) == (4000.0, 2.0, (30.0, 300.0))
    assert (made.solver.method, made.compensation.decouple) == ("fast", True)


OTHERS = [
    Settings(),
    best_mode(),
    quick_mode(),
    quiet_mode(),  # with ears at three places
    Settings().but(method=LevenbergMarquardt(tolerance=1e-3, iterations=7), level="auto", circle=Circle(radius=2e-3)),
    Settings().but(method=Fast(iterations=9), iterations=(5, 5), guard=0.02, fit="cells"),
    Settings().but(grid=ControlGrid(rows=3, columns=5, centre=(1e-3, -2e-3)), decouple=True),
    Settings(acoustics=Acoustics(medium=Medium.at(temperature=24.0, humidity=0.4), directivity="piston")),
]


def test_settings_are_the_same_after_a_file_and_after_a_provenance(tmp_path):
    for number, settings in enumerate(OTHERS):
        settings.save(tmp_path / "take.toml")
        assert Settings.load(tmp_path / "take.toml") == settings, number
        assert Settings.of(settings.noted(Provenance())) == settings, number
    for fit in (Cells(), Windows()):
        chosen = Settings().but(fit=fit)
        with pytest.raises(InputError, match="fit: expected"):
            chosen.plain()
        assert Settings.of(chosen.noted(Provenance())) is None, "a fit with settings of its own has no text"


def test_a_file_that_does_not_fit_is_one_clear_line(tmp_path):
    path = tmp_path / "take.toml"
    for text, says in (
        ("[solver]\nmethods = 'fast'", "solver.methods: expected one of amplitudes"),
        ("[solver.method]\nname = 'lm'\ntolerance = 'low'", "solver.method.tolerance: expected float, got 'low'"),
        ("[solver.method]\nname = 'magic'", "method: expected one of lm"),
        ("[target]\ninterpolate = 'sound'", "target.interpolate: expected amplitude or pressure, got 'sound'"),
        ("[target.grid]\nrows = 0", "grid: expected at least 1 row"),
        ("target = 4", "target: expected"),
        ("[solver\n", "expected settings in TOML"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(BrokenFileError, match=says):
            Settings.load(path)


def test_a_temperature_in_a_file_sets_the_whole_medium(tmp_path):
    path = tmp_path / "take.toml"
    path.write_text("[acoustics.medium]\ntemperature = 26\nhumidity = 0.3\n", encoding="utf-8")
    assert Settings.load(path).acoustics.medium == Medium.at(temperature=26.0, humidity=0.3)
    path.write_text("[acoustics.medium]\ntemperature = 'warm'\n", encoding="utf-8")
    with pytest.raises(BrokenFileError, match=r"acoustics\.medium\.temperature: expected float"):
        Settings.load(path)
    path.write_text("[acoustics.medium]\ntemperature = 26\nhumidity = 0.3\nspeed = 340\n", encoding="utf-8")
    with pytest.raises(BrokenFileError, match="got 340"):
        Settings.load(path)


def test_settings_of_the_modes():
    plain = {"fit": "windows", "level": 1.0, "amplitudes": "equal", "predict": False, "convergence": "auto"}
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
    last = replace(best.solver.method, smooth_last=best.solver.method.smooth)
    assert quick_mode().but(rate=4000.0) == finest_mode().but(quiet_palm=0.0, **plain) == best.but(method=last)
    assert finest_mode().solver.quiet_palm
    assert quiet_mode().but(method=best.solver.method, convergence="auto", quiet_ears=0.0, ears=None) == best


def test_a_coarser_grid_spans_the_same_square_and_modes_side_by_side_are_in_one_air():
    rough = with_fewer_points(Settings(), 11).target.grid
    assert rough.x[[0, -1]] == pytest.approx(Settings().target.grid.x[[0, -1]])
    assert rough.count == 121
    warm = paper_mode().but(acoustics=Acoustics(medium=Medium.at(temperature=25.0)))
    assert {settings.acoustics for settings in with_paper_mode("best", warm).values()} == {warm.acoustics}
    mine = best_mode()
    assert with_paper_mode("best", warm, mine)["best"] is mine
