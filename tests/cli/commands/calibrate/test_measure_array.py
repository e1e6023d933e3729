import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.model.test_calibration import calibration as known

from midair.cli import run
from midair.files import load_array_calibration, load_solution, open_take, save_array_calibration
from midair.model import TransducerArray
from midair.rig import keep_array_calibration

QUICK = shlex.split("--mode paper --set target.grid={rows=4,columns=4} --set solver.iterations=[3,2] --duration 0.01s")


@pytest.mark.long
def test_a_drive_is_solved_for_the_array_as_it_was_measured(take, answer):
    calibration = known(TransducerArray.autd3())
    save_array_calibration(calibration, "mine.array.h5")
    assert run(["solve", "take.h5", *QUICK, "--array-calibration", "mine.array.h5"]) == 0
    drive = load_solution("take.drive.h5").drive
    np.testing.assert_array_equal(drive.array.response, calibration.response)
    step = next(step for step in drive.provenance.steps if step.stage == "array calibration")
    assert step.settings["id"] == calibration.identifier
    assert run(["play", "take.drive.h5"]) == 0
    told = answer("info", "mine.array.h5")
    assert (told["dead"], told["array"]) == ("1: 7", "AUTD3 2 x 2, 996 transducers")


@pytest.mark.long
def test_another_array_and_another_file_are_refused_in_one_line(take, one_line):
    save_array_calibration(known(TransducerArray.autd3(columns=1, rows=1)), "one.array.h5")
    for name, word in (("one.array.h5", "measure this array"), ("take.h5", "midair array"), ("gone.array.h5", "gone")):
        assert run(["solve", "take.h5", *QUICK, "--array-calibration", name]) == 1
        assert word in one_line()
    assert not Path("take.drive.h5").exists()


@pytest.mark.long
def test_a_real_array_is_solved_for_its_stored_calibration(take, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    calibration = known(TransducerArray.autd3())
    keep_array_calibration("autd3:eth0", calibration)
    solve = ["solve", "take.h5", *QUICK, "-f", "--device"]
    assert run([*solve, "autd3:eth0"]) == 0
    assert f"({calibration.identifier}), " in capsys.readouterr().err
    drive = load_solution("take.drive.h5").drive
    np.testing.assert_array_equal(drive.array.response, calibration.response)
    step = next(step for step in drive.provenance.steps if step.stage == "array calibration")
    assert step.settings["id"] == calibration.identifier
    for words in (["virtual"], ["autd3:eth1"], ["autd3:eth0", "--array-calibration", "none"]):
        assert run([*solve, *words]) == 0
        assert load_solution("take.drive.h5").drive.array.alike
    assert "array calibration" not in capsys.readouterr().err


@pytest.mark.slow
def test_the_virtual_array_is_measured_from_the_command_line(capsys):
    assert run(["calibrate", "array", "virtual", "a.array.h5", "--override-exposure", "a test"]) == 0
    assert "strength" in capsys.readouterr().out
    found = load_array_calibration("a.array.h5")
    assert np.median(found.strength_uncertainty) < 0.01
    assert np.median(found.phase_uncertainty) < 0.01
    assert np.median(found.resonance_uncertainty) < 20  # docs/calibrate.md: 39 Hz at k = 2
    check = ["calibrate", "array", "virtual", "a.array.h5", "--check", "--override-exposure", "a test"]
    assert run(check) == 0
    assert "holds" in capsys.readouterr().out
    assert run([*check, "--seed", "1"]) == 1
    assert "transducers changed" in capsys.readouterr().out


@pytest.mark.long
def test_the_virtual_array_plays_on_measured_transducers(capsys):
    """A measured array that is half as strong presses a quarter; a quarter of a turn on all of them is not heard."""
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.2s"]) == 0
    words = shlex.split(
        "--set target.grid={rows=4,columns=4,pitch=0.011} --method fast --mode paper --set solver.guard=0.0"
    )
    assert run(["solve", "take.h5", *words, "--start-at", "0.15s", "--duration", "0.02s", "-f"]) == 0
    array = TransducerArray.autd3()
    for name, response in (("whole", 1.0), ("half", 0.5), ("turned", 1j), ("silent", 1e-6)):
        made = known(array)
        save_array_calibration(replace(made, response=np.full(array.count, response + 0j)), f"{name}.array.h5")
        play = ["play", "take.drive.h5", "--array-calibration", f"{name}.array.h5", "--output", f"{name}.h5", "-f"]
        assert run(play) == 0
    capsys.readouterr()
    # The sensor's noise is the same in all, by its seed.
    whole, half, turned, silent = (
        open_take(f"{name}.h5").recording.samples for name in ("whole", "half", "turned", "silent")
    )
    heard = np.linalg.norm(whole - silent)
    assert np.linalg.norm(half - silent) / heard == pytest.approx(0.25, abs=0.01)
    assert np.linalg.norm(turned - whole) < 0.02 * heard


def test_array_calibration_is_refused_on_a_real_array(capsys):
    save_array_calibration(known(TransducerArray.autd3()), "b.array.h5")
    assert run(["play", "any.drive.h5", "--device", "autd3", "--array-calibration", "b.array.h5"]) == 1
    assert "--array-calibration: expected --device virtual" in capsys.readouterr().err
