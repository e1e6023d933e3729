import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.cli import run
from midair.cli.options import BandOptions, SolveOptions, format_quantity, parse_quantity
from midair.files import load_solution
from midair.model import Acoustics, ControlGrid
from midair.settings import MODES, Settings, best_mode
from midair.solvers import Guard
from midair.targets import Circle

FEW = "--set target.grid={rows=6,columns=6,pitch=0.011} --method fast --set solver.iterations=[2,2]"


def test_default_options_are_those_of_the_best_mode_and_the_default_band_is_the_paper_s():
    assert SolveOptions().settings() == best_mode()
    assert BandOptions().settings() == Settings()


@pytest.fixture
def stroke(tmp_path):
    assert run(["record", "virtual:am-i", str(tmp_path / "am.h5"), "--duration", "0.1s"]) == 0
    return tmp_path / "am.h5"


@pytest.mark.long
def test_the_command_line_of_fidelity(stroke, tmp_path):
    """Rate, mapping, decoupling, pre-compensation and motion reach the drive that is written."""
    drive = tmp_path / "am.drive.h5"
    words = "--rate 4kHz --mapping slow-bias --circle 3mm --set target.interpolate=pressure"
    more = "--set compensation.decouple=true --set compensation.precompensate=true"
    small = f"{more} {FEW} --start-at 20ms --duration 10ms --lead 0s"
    assert run(["solve", str(stroke), str(drive), *words.split(), *small.split()]) == 0
    solved = load_solution(drive).drive
    made = {step.stage: step.settings for step in solved.provenance.steps}
    assert (solved.rate, solved.frames) == (4000, 40)
    assert list(made)[-4:] == ["decouple", "prepare", "precompensate sound", "solve"]
    assert made["prepare"]["mapping"] == "slow-bias"
    assert made["prepare"]["motion"] == "circle of 3 mm at 5 Hz, not validated on people"


def test_a_mode_by_name_and_single_options_on_top():
    for mode, settings in MODES.items():
        assert SolveOptions(mode=mode).settings() == settings(), mode
        assert SolveOptions(mode=mode, rate=2000.0).settings() == settings().but(rate=2000.0), mode


def test_terms_are_switched_on_off_and_changed():
    margin = ("solver.guard.margin=0.02",)
    assert SolveOptions(mode="paper", method="lm", set=margin).settings().solver.guard == Guard(margin=0.02)
    best = best_mode().solver.guard
    assert SolveOptions(mode="best", set=margin).settings().solver.guard == replace(best, margin=0.02)
    off = ("solver.guard=0.0", "compensation.decouple=false")
    assert SolveOptions(mode="best", set=off).settings() == best_mode().but(guard=0.0, decouple=False)
    circled = SolveOptions(circle=2e-3, set=("target.circle.frequency=4.0",)).settings()
    assert circled.target.circle == Circle(radius=2e-3, frequency=4.0)
    few = ("target.grid.rows=8", "target.grid.columns=8", "solver.level=auto")
    assert SolveOptions(set=few).settings().target.grid == ControlGrid(rows=8, columns=8)
    assert SolveOptions(set=few).settings().solver.level == "auto"
    point = SolveOptions(mode="paper", directivity="point").settings()
    assert point.acoustics == Acoustics(directivity="point")


@pytest.mark.long
def test_a_drive_is_made_again_from_its_own_settings():
    assert run(["record", "virtual:am-i", "am.h5", "--duration", "0.1s"]) == 0
    part = ["--start-at", "20ms", "--duration", "5ms"]
    words = f"--mode quick {FEW.partition(' --method')[0]} --set solver.guard.margin=0.022".split()
    assert run(["solve", "am.h5", "one.drive.h5", *words, *part]) == 0
    assert run(["solve", "am.h5", "two.drive.h5", "--settings", "one.drive.h5", *part]) == 0
    one, two = load_solution("one.drive.h5"), load_solution("two.drive.h5")
    np.testing.assert_array_equal(one.drive.phase, two.drive.phase)
    assert Settings.of(one.drive.provenance) == Settings.of(two.drive.provenance)


SMALL = f"--mode paper {FEW} --duration 10ms"


def test_the_finest_mode_takes_the_outline_of_a_palm(tmp_path):
    (tmp_path / "hand.toml").write_text("disc_mm = 90", encoding="utf-8")
    options = SolveOptions(mode="finest", palm=tmp_path / "hand.toml")
    assert options.settings().solver.quiet_palm.outline
    assert [each.mode_name for each in (options, SolveOptions(mode="paper"))] == ["the finest mode", "the paper's mode"]


@pytest.mark.long
def test_strength_is_printed_in_pascal_with_a_warning_above_the_limit(stroke, tmp_path, capsys, answer):
    drive = str(tmp_path / "am.drive.h5")
    solve = ["solve", str(stroke), drive, *SMALL.split(), "--start-at", "20ms", "--lead", "0s", "--strength"]
    assert run([*solve, "0.1"]) == 0
    assert "too strong" not in capsys.readouterr().err
    assert run([*solve, "1.2", "--force", "--json"]) == 0
    told = capsys.readouterr()
    level = json.loads(told.out)["level"]
    assert level["too_loud"]
    assert level["comes"] < 0.8
    assert "use --strength" in told.err
    assert answer("info", drive)["level"] == level


READ = """
m: 200mm 0.2, 11 mm 0.011, 0.2m 0.2, 250µm 250e-6
Hz: 20Hz 20, 1kHz 1000
s: 500ms 0.5, .5s 0.5, 1.5 min 90, -0.5s -0.5
Pa: 30Pa 30
V/Pa: 20mV/Pa 0.02
count/Pa: 2count/Pa 2
m/s: 50mm/s 0.05, 3cm/min 0.0005
kg: 2g 0.002
C: 22C 22, 22 22, 21.5 °C 21.5, 295.15K 22, 71.6F 22, -3C -3
K: 2C 2, 2K 2, 3.6F 2
%: 50% 0.5, 12.5 % 0.125
"""
"""Units, and what is read in them."""


def test_reads():
    for unit, row in (line.split(": ") for line in READ.strip().splitlines()):
        for text, value in (each.rsplit(" ", 1) for each in row.split(", ")):
            assert parse_quantity(text, unit) == pytest.approx(float(value)), (text, unit)


@given(st.floats(1e-3, 1e3), st.floats(0, 50))
def test_printed_quantities_can_be_parsed(length, value):
    assert parse_quantity(format_quantity(length, "m"), "m") == pytest.approx(length, rel=1e-5)
    for unit in ("C", "K", "%"):
        assert parse_quantity(format_quantity(value, unit), unit) == pytest.approx(value, rel=1e-5, abs=1e-9), unit


@pytest.mark.long
@given(st.text(max_size=12))
def test_any_text_is_read_or_refused(text):
    try:
        parse_quantity(text, "m")
    except ValueError as refused:
        assert "expected a quantity" in str(refused)
