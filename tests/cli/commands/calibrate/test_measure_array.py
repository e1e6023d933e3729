"""The command calibrate array, and drives that are solved for what it wrote."""

import json
from pathlib import Path

import numpy as np
import pytest

from midair.cli import run
from midair.files import load_array_calibration, load_solution, save, save_array_calibration
from midair.model import ArrayCalibration, Calibration, Recording, TransducerArray

QUICK = ("--mode", "paper", "--points", "4", "--iterations", "3", "2", "--duration", "0.01s")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def known(array):
    rng, count = np.random.default_rng(0), array.count
    return ArrayCalibration(
        array=array,
        response=(0.9 + 0.05 * rng.standard_normal(count)) * np.exp(0.1j * rng.standard_normal(count)),
        pole=np.full(count, -5000 + 1200j),
        **{f"{name}_uncertainty": np.full(count, 0.01) for name in ("strength", "phase", "resonance", "quality")},
        dead=np.arange(count) == 3,
        date="2026-11-22",
    )


@pytest.fixture
def take():
    samples = np.random.default_rng(0).normal(size=(200, 4, 4))
    recording = Recording(samples=samples, rate=1000)
    save(recording, "take.h5", calibration=Calibration.flat(recording.sensor, sensitivity=0.02))


def test_a_drive_is_solved_for_the_array_as_it_was_measured(take, capsys):
    calibration = known(TransducerArray.autd3())
    save_array_calibration(calibration, "mine.array.h5")
    assert run(["solve", "take.h5", *QUICK, "--array-calibration", "mine.array.h5"]) == 0
    drive = load_solution("take.drive.h5").drive
    np.testing.assert_array_equal(drive.array.response, calibration.response)
    step = next(step for step in drive.provenance.steps if step.stage == "array calibration")
    assert step.settings["id"] == calibration.identifier
    assert run(["play", "take.drive.h5"]) == 0
    capsys.readouterr()
    assert run(["info", "mine.array.h5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["dead"] == "1: 3"
    assert told["array"] == "AUTD3 2 x 2, 996 transducers"


def test_another_array_and_another_file_are_refused_in_one_line(take, capsys):
    save_array_calibration(known(TransducerArray.autd3(columns=1, rows=1)), "one.array.h5")
    for name, word in (("one.array.h5", "measure this array"), ("take.h5", "midair array"), ("gone.array.h5", "gone")):
        assert run(["solve", "take.h5", *QUICK, "--array-calibration", name]) == 1
        lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("midair: ")]
        assert len(lines) == 1
        assert word in lines[0]
    assert not Path("take.drive.h5").exists()


def test_codes_that_are_too_short_and_names_that_are_there_are_refused(capsys):
    assert run(["calibrate", "array", "virtual", "a.array.h5", "--duration", "0.1s"]) == 1
    assert "or more for 996 transducers" in capsys.readouterr().err
    save_array_calibration(known(TransducerArray.autd3()), "a.array.h5")
    assert run(["calibrate", "array", "virtual", "a.array.h5"]) == 1
    assert "--force" in capsys.readouterr().err


@pytest.mark.slow
def test_the_virtual_array_is_measured_from_the_command_line(capsys):
    assert run(["calibrate", "array", "virtual", "a.array.h5", "--override-exposure", "a test"]) == 0
    assert "strength" in capsys.readouterr().out
    found = load_array_calibration("a.array.h5")
    assert np.median(found.strength_uncertainty) < 0.01
    assert np.median(found.phase_uncertainty) < 0.01
    assert np.median(found.resonance_uncertainty) < 15
