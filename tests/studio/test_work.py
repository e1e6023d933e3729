"""What the worker process does, called by hand."""

import os

import pytest

from midair.datasets import stroke
from midair.files import load_solution, open_take, save
from midair.flow import felt, lead_of
from midair.model import Palm, Provenance, Recording
from midair.rig import BudgetPlan, VirtualRig, error_budget, hear_drive
from midair.settings import Settings
from midair.studio.work import SolveWish, budget_of_take, palm_of_take, solve_take
from midair.targets import led_in


@pytest.fixture
def solved(tmp_path):
    """A short stroke, 60 ms of which are solved in a few points."""
    frames = stroke("towel", duration=0.2)
    life = Provenance(source="x")
    take = Recording(samples=frames.pressure, rate=frames.rate, sensor=frames.sensor, unit="Pa", provenance=life)
    save(take, tmp_path / "towel.h5")
    wish = SolveWish(
        take=str(tmp_path / "towel.h5"),
        drive=str(tmp_path / "towel.drive.h5"),
        choices=(("method", "naive"), ("points", 4)),
        start=0.06,
        duration=0.06,
    )
    solve_take(wish, lambda *_: None)
    return wish


@pytest.mark.slow
def test_where_the_error_comes_from_is_the_budget_of_the_part_that_was_solved(solved):
    said = []
    found = budget_of_take((solved.take, solved.drive), lambda *told: said.append(told))
    drive, opened = load_solution(solved.drive).drive, open_take(solved.take)
    settings = Settings.of(drive.provenance)
    original = felt(opened.recording, opened.calibration, settings).cut(0.06, 0.06)
    rig = VirtualRig(cells=original.sensor, height=settings.target.grid.height).hearing(settings.calibration.band)
    made = error_budget(original, BudgetPlan(settings=settings, rig=rig, lead=lead_of(settings)))
    assert [row[0] for row in found["rows"]] == [each.name for each in made.stages]
    assert found["rows"][-1][2] == f"{made.stages[-1].so_far.distortion_ratio:.3g} dB"
    assert found["seconds"] == pytest.approx(0.06)
    assert said


@pytest.mark.slow
def test_the_palm_of_a_take_is_that_of_its_drive(solved):
    wish, said = solved, []
    found = palm_of_take((wish.take, wish.drive), lambda *told: said.append(told))
    drive = load_solution(wish.drive).drive
    settings = Settings.of(drive.provenance)
    opened = open_take(wish.take)
    assert found["seconds"] == pytest.approx(0.06)
    original = felt(opened.recording, opened.calibration, settings).cut(0.06, 0.06)
    rig = VirtualRig(cells=original.sensor, height=settings.target.grid.height).hearing(settings.calibration.band)
    heard = hear_drive(drive, original, led_in(original, lead_of(settings)), rig, palm=Palm.disc())
    assert found["rows"][0][0] == "power outside the square"
    assert found["rows"][0][1] == f"{100 * heard.palm.outside:.3g} %"
    assert found["stamp"] == f"{os.stat(wish.drive).st_mtime_ns:x}"
    assert said[-1][0] == "pressing on a palm"
