"""Every choice is said once: options, files, provenance and modes come from `settings`."""

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from midair.cli import run
from midair.cli.terminal import SolveOptions
from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import load_solution
from midair.model import Acoustics, ControlGrid, Medium, Provenance
from midair.settings import CHOICES, MODES, Settings, best_mode, coarser, paper_mode, quick_mode
from midair.solvers import Cells, Exact, Fast, Guard
from midair.targets import Circle

# What only Python can say: parts of what has an option, and constants of the array.
PYTHON_ONLY = {
    "target.grid.columns": "points",
    "target.grid.centre": "of the array",
    "compensation.dynamics": "of the transducers",
    "compensation.ramp": "of the silencer",
    "solver.guard": "guard, its margin",
    "target.circle": "circle, its radius",
    "acoustics.medium": "the air",
}


def leaves(value, before=""):
    for one in fields(value):
        got, path = getattr(value, one.name), f"{before}{one.name}"
        if is_dataclass(got) and path not in PYTHON_ONLY:
            yield from leaves(got, f"{path}.")
        else:
            yield path


def test_every_setting_is_a_choice_or_known_to_be_python_s():
    offered = {choice.path for choice in CHOICES}
    assert {path for path in leaves(Settings()) if path not in offered} == set(PYTHON_ONLY)


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


def test_but_finds_each_choice_in_its_group():
    made = Settings().but(rate=4000.0, gain=2.0, band=(30.0, 300.0), method="fast", decouple=True)
    assert (made.target.rate, made.target.gain, made.calibration.band) == (4000.0, 2.0, (30.0, 300.0))
    assert (made.solver.method, made.compensation.decouple) == ("fast", True)
    with pytest.raises(InputError, match=r"settings: expected some of band, .*, got loudness"):
        Settings().but(loudness=1)


OTHERS = [
    Settings(),
    best_mode(),
    quick_mode(),
    Settings().but(method=Exact(tolerance=1e-3, iterations=7), level="auto", circle=Circle(radius=2e-3)),
    Settings().but(method=Fast(iterations=9), iterations=(5, 5), guard=0.02, fit="cells"),
    Settings().but(grid=ControlGrid(rows=3, columns=5, centre=(1e-3, -2e-3)), inverse="fir"),
    Settings(acoustics=Acoustics(medium=Medium.at(temperature=24.0, humidity=0.4), directivity="piston")),
]


@pytest.mark.parametrize("settings", OTHERS, ids=range(len(OTHERS)))
def test_settings_are_the_same_after_a_file_and_after_a_provenance(settings, tmp_path):
    settings.save(tmp_path / "take.toml")
    assert Settings.load(tmp_path / "take.toml") == settings
    assert Settings.of(settings.noted(Provenance())) == settings


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[solver]\nmethods = 'fast'", "solver.methods: expected one of amplitudes"),
        ("[solver.method]\nname = 'exact'\ntolerance = 'low'", "solver.method.tolerance: expected float, got 'low'"),
        ("[solver.method]\nname = 'magic'", "method: expected one of lm"),
        ("[target]\ninterpolate = 'sound'", "target.interpolate: expected amplitude or pressure, got 'sound'"),
        ("[target.grid]\nrows = 0", "grid: expected at least 1 row"),
        ("target = 4", "target: expected"),
        ("[solver\n", "expected settings in TOML"),
    ],
)
def test_a_file_that_does_not_fit_is_one_clear_line(text, says, tmp_path):
    path = tmp_path / "take.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BrokenFileError, match=says):
        Settings.load(path)


def test_no_file_is_said():
    with pytest.raises(MissingFileError, match=r"no\.toml: expected settings in TOML"):
        Settings.load("no.toml")


def test_cells_of_their_own_have_no_text():
    chosen = Settings().but(fit=Cells())
    with pytest.raises(InputError, match="fit: expected"):
        chosen.plain()
    assert Settings.of(chosen.noted(Provenance())) is None


def test_the_options_that_nobody_gave_are_the_paper_s():
    assert SolveOptions().settings() == Settings()


@pytest.mark.parametrize("mode", MODES)
def test_a_mode_by_name_and_single_options_on_top(mode):
    assert SolveOptions(mode=mode).settings() == MODES[mode]()
    assert SolveOptions(mode=mode, rate=2000.0).settings() == MODES[mode]().but(rate=2000.0)


def test_terms_are_switched_on_off_and_changed():
    assert SolveOptions(guard=0.02).settings().solver.guard == Guard(margin=0.02)
    best = best_mode().solver.guard
    assert SolveOptions(mode="best", guard=0.03).settings().solver.guard == replace(best, margin=0.03)
    assert SolveOptions(mode="best", guard=0.0, decouple=False).settings() == best_mode().but(
        guard=None, decouple=False
    )
    circled = SolveOptions(circle=2e-3, circle_rate=4.0).settings()
    assert circled.target.circle == Circle(radius=2e-3, frequency=4.0)
    with pytest.raises(InputError, match="--circle-rate: expected --circle beside it"):
        SolveOptions(circle_rate=4.0).settings()
    assert SolveOptions(points=8).settings().target.grid == ControlGrid(rows=8, columns=8)
    assert SolveOptions(directivity="point").settings().acoustics == Acoustics(directivity="point")


def test_mode_and_file_together_are_refused(tmp_path):
    with pytest.raises(InputError, match="expected --mode or --settings"):
        SolveOptions(mode="best", settings_file=tmp_path / "take.toml").settings()


def test_a_drive_is_made_again_from_its_own_settings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["record", "virtual:am-i", "am.h5", "--duration", "0.1s"]) == 0
    part = ["--start-at", "20ms", "--duration", "5ms"]
    words = ["--mode", "quick", "--points", "6", "--pitch", "11mm", "--guard", "22mm", "--iterations", "3", "3"]
    assert run(["solve", "am.h5", "one.drive.h5", *words, *part]) == 0
    assert run(["solve", "am.h5", "two.drive.h5", "--settings", "one.drive.h5", *part]) == 0
    one, two = load_solution("one.drive.h5"), load_solution("two.drive.h5")
    np.testing.assert_array_equal(one.drive.phase, two.drive.phase)
    assert Settings.of(one.drive.provenance) == Settings.of(two.drive.provenance)


@pytest.mark.parametrize("command", ["solve", "loop", "budget", "demo"])
def test_the_help_of_a_command_fits_a_hundred_lines(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert run([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "--mode" in said
    if command == "solve":
        assert len(said.splitlines()) <= 100
