"""What the worker process does, called by hand."""

import os

import pytest

from midair.datasets import stroke
from midair.files import load_solution, open_take, save
from midair.flow import felt, lead_of
from midair.model import Palm, Provenance, Recording
from midair.rig import VirtualRig, hear_drive
from midair.settings import Settings
from midair.studio.work import SolveWish, palm_of_take, solve_take
from midair.targets import led_in


@pytest.mark.slow
def test_the_palm_of_a_take_is_that_of_its_drive(tmp_path):
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
    said = []
    solve_take(wish, lambda *_: None)
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
