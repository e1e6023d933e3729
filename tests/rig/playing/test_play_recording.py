"""A recording that plays while it is solved: the same drive and the same pressure as when it is solved first."""

import threading
from dataclasses import replace

import h5py
import numpy as np
import pytest

from midair.cli import run
from midair.devices import check_exposure
from midair.errors import InputError, StoppedError
from midair.files import load, load_solution, save
from midair.model import Calibration, ControlGrid, Recording, SensorGrid
from midair.pipeline import calibrated_pressure, reproduce_stream, required_lead
from midair.rig import OpenRig, PlaySettings, VirtualRig, play, solving
from midair.settings import Settings
from midair.targets import add_lead

GRID = SensorGrid()
SOLVE = Settings().but(grid=ControlGrid(rows=6, columns=6, pitch=11e-3), method="fast")
QUICK = [
    *("--mode", "paper", "--points", "6", "--pitch", "11mm", "--method", "fast"),
    *("--lead", "20ms", "--start-at", "0.1s", "--duration", "0.1s"),
]
TAKE = Recording(samples=0.05 * np.random.default_rng(0).standard_normal((300, 4, 4)), rate=1000.0, unit="V")
RIG = VirtualRig()
DEVICE = RIG.array_device()


def pressure(frames=300):
    pascals = replace(TAKE, samples=20 * TAKE.samples[:frames], unit="Pa")
    return add_lead(calibrated_pressure(pascals, None, SOLVE), required_lead(SOLVE))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(TAKE, tmp_path / "take.h5", calibration=Calibration.flat(GRID, sensitivity=0.02))
    return tmp_path


def values(path):
    with h5py.File(path) as file:
        attributes = {name: value for name, value in file.attrs.items() if name != "created"}
        return attributes, {name: item[()] for name, item in file.items()}


@pytest.mark.long
def test_the_command_writes_the_drive_of_solve_and_its_pressure(folder, capsys):
    assert run(["solve", "take.h5", *QUICK]) == 0
    assert run(["play", "take.drive.h5", "--output", "first.h5"]) == 0
    assert run(["play", "take.h5", *QUICK, "--drive", "own.drive.h5", "--output", "second.h5"]) == 0
    captured = capsys.readouterr()
    assert "SIMULATED" in captured.err
    (attributes, items), (own_attributes, own_items) = values("take.drive.h5"), values("own.drive.h5")
    assert own_attributes == attributes
    assert own_items.keys() == items.keys()
    for name, value in items.items():
        np.testing.assert_array_equal(own_items[name], value, err_msg=name)
    first, second = (load(name).samples for name in ("first.h5", "second.h5"))
    # The silencer is chosen by the frames that are there when it begins; here all are.
    np.testing.assert_allclose(second, first, atol=1e-6 * np.abs(first).max())


REFUSED = {
    "--mode: expected a recording": ["take.drive.h5", "--mode", "quick"],
    "--lead: expected a recording": ["take.drive.h5", "--lead", "20ms"],
    "--drive: expected a recording": ["take.drive.h5", "--drive", "a.drive.h5"],
    "--correct-air: expected a drive": ["take.h5", "--correct-air", "--temperature", "20C"],
    "--palm: expected --quiet-palm": ["take.h5", "--palm", "palm.toml"],
    "a name that ends in .drive.h5": ["take.h5", "--drive", "a.h5"],
}


@pytest.mark.parametrize("said", REFUSED)
def test_options_without_effect_are_refused(said, folder, capsys):
    assert run(["play", *REFUSED[said]]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.long
def test_python_plays_a_recording_on_a_rig_and_keeps_its_drive(tmp_path):
    pascals = replace(TAKE, samples=20 * TAKE.samples[:100], unit="Pa")
    skin = RIG.skin()
    with OpenRig(array=RIG.array_device(skin), sensor=RIG.sensor(skin), settings=PlaySettings()) as rig:
        played = play(pascals, rig, solve=SOLVE, keep=tmp_path / "a.drive.h5")
    kept = load_solution(tmp_path / "a.drive.h5").drive
    assert played.take.recording.frames == kept.frames + 20
    assert played.outcome == check_exposure(kept, DEVICE, rig.exposure).outcome
    _, parts = reproduce_stream(pressure(100), RIG.array, SOLVE)
    np.testing.assert_array_equal(kept.phase, np.concatenate([part.drive.phase for part in parts]))
    with pytest.raises(InputError, match="expected a recording with solve or keep, got a drive"):
        play(kept, solve=SOLVE)


def test_leaving_stops_the_solver_and_writes_nothing(tmp_path):
    with (
        pytest.raises(KeyboardInterrupt),
        solving(pressure(), RIG.array, SOLVE, DEVICE, PlaySettings().exposure, keep=tmp_path / "a.drive.h5") as stream,
    ):
        raise KeyboardInterrupt
    assert not [each for each in threading.enumerate() if each.name == "midair solve"]
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(StoppedError, match="stopped with the playback"):
        stream.clearance()


def test_an_error_of_the_solver_reaches_the_player():
    bad = SOLVE.but(level=2.0)
    with pytest.raises(InputError, match="level"), solving(pressure(), RIG.array, bad, DEVICE, PlaySettings().exposure):
        pass
