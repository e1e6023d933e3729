import os
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest
from tests.model.test_calibration import calibration

from midair.cli.output import describe_drive
from midair.datasets import stroke
from midair.errors import InputError
from midair.files import load_solution, open_take, save
from midair.model import ControlGrid, Provenance, Recording, TransducerArray
from midair.pipeline import calibrated_pressure, required_lead, under_ears
from midair.rig import BudgetPlan, VirtualRig, error_budget, keep_array_calibration, palm_of_drive, play
from midair.settings import Settings
from midair.studio.importing import run_report
from midair.studio.take_data import TakeData, facts
from midair.studio.work import SolveRequest, StudyRequest, budget_of_take, compare_takes, palm_of_take, solve_take
from midair.study import read_design
from midair.targets import add_lead


@pytest.fixture
def solved(tmp_path):
    """A short stroke with 60 ms solved at a few points."""
    frames = stroke("towel", duration=0.2)
    life = Provenance(source="x")
    take = Recording(samples=frames.pressure, rate=frames.rate, sensor=frames.sensor, unit="Pa", provenance=life)
    save(take, tmp_path / "towel.h5")
    request = SolveRequest(
        take=str(tmp_path / "towel.h5"),
        drive=str(tmp_path / "towel.drive.h5"),
        choices=(("method", "fast"), ("grid", ControlGrid(rows=4, columns=4))),
        start=0.06,
        duration=0.06,
    )
    solve_take(request, lambda *_: None)
    return request


@pytest.mark.long
def test_drive_that_appears_during_a_solve_is_kept(solved):
    """For example by a command, minutes after the request."""
    drive = Path(solved.drive)
    before = drive.stat().st_mtime_ns
    with pytest.raises(InputError, match=r"towel\.drive\.h5: expected no drive of this name, found another one since"):
        solve_take(solved, lambda *_: None)
    request = replace(solved, replaces=f"{before:x}", outdated=((f"{drive}.a", ""), (solved.take, "of another time")))

    def meanwhile(*_):
        os.utime(drive, ns=(5, 5))

    with pytest.raises(InputError, match="expected the drive that was to be replaced, found another one since"):
        solve_take(request, meanwhile)
    solve_take(replace(request, replaces="5"), lambda *_: None)
    assert drive.stat().st_mtime_ns > 5
    assert sorted(path.name for path in drive.parent.iterdir()) == ["towel.drive.h5", "towel.h5"]


@pytest.mark.long
def test_a_drive_for_a_real_array_takes_its_stored_calibration(solved, monkeypatch, tmp_path):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    keep_array_calibration("autd3:eth0", calibration(TransducerArray.autd3()))
    request = replace(solved, device="autd3:eth0", drive=str(tmp_path / "measured.drive.h5"))
    solve_take(request, lambda *_: None)
    drive = load_solution(request.drive).drive
    assert not drive.array.alike
    shown = facts(TakeData(take=solved.take, drive=request.drive))["drive"]
    assert f"({drive.provenance.last('solve')['array_calibration']}), " in shown["array_calibration"]
    # The felt line is that of `midair info`.
    felt = next(row for row in describe_drive(Path(request.drive))[1] if getattr(row, "name", "") == "predicted")
    assert [name for name, _ in shown["verdict"]] == ["felt, predicted", "pressure", "left out"]
    assert f"felt {shown['verdict'][0][1]}" == felt.text
    assert shown["verdict"][2][1].startswith("the slow press below ")
    # The form shows the settings as they were chosen.
    assert (shown["settings"]["mode"], shown["settings"]["method"]) == ("paper", "fast")
    plain = replace(request, array_calibration=Path("none"), drive=str(tmp_path / "plain.drive.h5"))
    solve_take(plain, lambda *_: None)
    assert load_solution(plain.drive).drive.array.alike


@pytest.mark.long
def test_the_mode_quiet_keeps_the_level_at_the_ears(solved, tmp_path):
    request = replace(
        solved,
        mode="quiet",
        choices=(("ears", 115.0), ("grid", ControlGrid(rows=8, columns=8))),
        drive=str(tmp_path / "q.drive.h5"),
    )
    solve_take(request, lambda *_: None)
    drive = load_solution(request.drive).drive
    assert -3 < under_ears(drive, 115.0) <= 0
    shown = facts(TakeData(take=solved.take, drive=request.drive))["drive"]["settings"]
    assert (shown["mode"], shown["ears_db"]) == ("quiet", 115.0)


@pytest.mark.long
def test_a_re_recording_of_another_drive_is_recognised_and_its_report_has_the_verdict_of_the_page(solved, tmp_path):
    again, kept = tmp_path / "towel.rerecorded.h5", tmp_path / "kept.npz"
    heard = play(load_solution(solved.drive), "virtual").take
    save(heard.recording, again, calibration=heard.calibration)

    def shown():
        return compare_takes((solved.take, str(again), str(kept), solved.drive), lambda *_: None)

    run_report((Path(solved.take), again, page := tmp_path / "towel.report.html"), lambda *_: None)
    report = " ".join(re.sub(r"<[^>]+>|\n", " ", unescape(page.read_text(encoding="utf-8"))).split())
    told = [text.replace("solve with ", "solve with --").replace(":", " :") for _, text in shown()["verdict"]]
    assert [text for text in told if text not in report] == []
    assert "midair compare towel.h5 towel.rerecorded.h5 --report" in report
    stamp = f"{os.stat(solved.drive).st_mtime_ns:x}"
    assert shown()["drive"] == stamp
    solve_take(replace(solved, replaces=stamp, choices=(*solved.choices, ("gain", 0.9))), lambda *_: None)
    assert shown()["drive"] == ""
    Path(solved.drive).unlink()
    assert shown()["drive"] == ""


def test_threshold_of_one_take_is_measured_by_its_drive():
    text = StudyRequest(path="s", template="detection", participants=5, takes=("/x/wool.h5",)).text()
    design = read_design(text, name="s")
    assert design.title == "Detection threshold of wool in midair"
    assert {one.source for one in design.stimuli if one.kind == "drive"} == {"wool.drive.h5"}


@pytest.mark.long
def test_budget_is_that_of_the_solved_part(solved):
    said = []
    found = budget_of_take((solved.take, solved.drive), lambda *told: said.append(told))
    drive, opened = load_solution(solved.drive).drive, open_take(solved.take)
    settings = Settings.of(drive.provenance)
    original = calibrated_pressure(opened.recording, opened.calibration, settings).cut(0.06, 0.06)
    rig = VirtualRig(cells=original.sensor, height=settings.target.grid.height).hearing(settings.calibration.band)
    made = error_budget(original, BudgetPlan(settings=settings, rig=rig, lead=required_lead(settings)))
    assert [row[0] for row in found["rows"]] == [each.name for each in made.stages]
    assert found["rows"][-1][2] == f"{made.stages[-1].so_far.distortion_ratio:.3g} dB"
    assert found["seconds"] == pytest.approx(0.06)
    assert said


@pytest.mark.long
def test_the_palm_of_a_take_is_that_of_its_drive(solved):
    request, said = solved, []
    found = palm_of_take((request.take, request.drive), lambda *told: said.append(told))
    drive = load_solution(request.drive).drive
    settings = Settings.of(drive.provenance)
    opened = open_take(request.take)
    assert found["seconds"] == pytest.approx(0.06)
    original = calibrated_pressure(opened.recording, opened.calibration, settings).cut(0.06, 0.06)
    rig = VirtualRig(cells=original.sensor, height=settings.target.grid.height).hearing(settings.calibration.band)
    lead = required_lead(settings)
    came = palm_of_drive(add_lead(original, lead), drive, rig)
    palm = came.fidelity(judged=(lead, original.frames / original.rate), band=settings.calibration.band)
    assert found["rows"][0][0] == "power outside the square"
    assert found["rows"][0][1] == f"{100 * palm.outside:.3g} %"
    assert found["stamp"] == f"{os.stat(request.drive).st_mtime_ns:x}"
    assert said[-1][0] == "simulating the palm"
