"""The main jobs from end to end on the virtual rig, by commands and public Python: exit status, files and figures."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.waiting import wait_until

import midair
from midair.cli import run
from midair.files import save_solution
from midair.settings import quick_mode

COARSE = (
    "--mode quick --set target.grid={rows=8,columns=8,pitch=0.0073333} --set solver.guard=0.0 --set solver.fit=points "
    "--start-at 0.45s --lead 20ms"
)
"""Settings of a fast solve: 8 x 8 control points on the whole sensor, in the loudest part of the stroke."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("jobs")


@pytest.fixture(autouse=True)
def _in_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


@pytest.fixture
def job(capsys):
    """Run a command line, check its exit status, and return what it prints as JSON with --json."""

    def job(line, *, status=0):
        capsys.readouterr()
        assert run(line.split()) == status, line
        out = capsys.readouterr().out
        return json.loads(out) if "--json" in line else None

    return job


@pytest.fixture
def take(job):
    if not Path("take.h5").exists():
        job("record virtual:towel take.h5 --duration 0.6s")
    return Path("take.h5")


@pytest.fixture
def drive(take, job):
    if not Path("towel.drive.h5").exists():
        job(f"solve {take} towel.drive.h5 {COARSE} --duration 50ms")
    return Path("towel.drive.h5")


def opened(path):
    take = midair.open_take(path)
    return take.recording, take.calibration


def figures(comparison):
    return {name: figure["value"] for name, figure in comparison["figures"].items()}


def test_record(job):
    (found,) = job("record virtual:towel stroke.h5 --duration 0.3s --json")
    assert (found["frames"], found["rate_hz"], found["lost_frames"], found["dead_channels"]) == (300, 1000, 0, [])
    volts = midair.load("stroke.h5")
    assert volts.unit == "V"
    assert (volts.samples.shape, volts.provenance.simulated) == ((300, 4, 4), True)
    assert [volts.samples.min(), volts.samples.max()] == pytest.approx(found["range"])


def test_import(job):
    time_s = np.arange(400) / 2000
    tone = np.sin(2 * np.pi * 100 * time_s)
    rows = [f"{at:.6f},{value:.9f}" for at, value in zip(time_s, tone, strict=True)]
    Path("tone.csv").write_text("\n".join(["time,force", *rows]), encoding="utf-8")
    found = job("import tone.csv tone.h5 --channels force --scale 2Pa --json")
    assert (found["frames"], found["rate_hz"], found["unit"]) == (400, pytest.approx(2000), "Pa")
    assert found["range"] == pytest.approx([-2, 2], abs=1e-6)
    assert midair.load("tone.h5").samples.ravel() == pytest.approx(2 * tone, abs=1e-6)
    sample = job("import sample:ridges ridges.h5 --json")
    assert sample["range"][1] == pytest.approx(90)
    assert not sample["simulated"]


@pytest.mark.long
def test_calibrate(take, job):
    """A sensor is measured against a reference microphone: its response is near that of the model."""
    job("calibrate bench lab --duration 6s")
    lab = sorted(str(path) for path in Path("lab").glob("*.h5"))
    reference = [path for path in lab if path.endswith("-reference.h5")]
    takes = [path.replace("-reference", "") for path in reference]
    assert len(takes) > 16
    words = "--reference-sensitivity 50mV/Pa --reference-uncertainty 0.02 --quiet lab/quiet.h5"
    files = f"{' '.join(takes)} --reference {' '.join(reference)}"
    job(f"calibrate measure {files} {words} --output sensor.calibration.h5 --json")
    found = midair.load_calibration("sensor.calibration.h5")
    model = midair.record("virtual:towel", 0.1).calibration  # the sensor of the bench differs from it a little
    tones = np.array([50.0, 100.0, 300.0])
    ratio = abs(found.response_at(tones) / model.response_at(tones))
    assert np.median(ratio) == pytest.approx(1, abs=0.1)
    assert (ratio.min() > 0.7, ratio.max() < 1.4) == (True, True)
    assert 0 < np.median(found.measurement.magnitude_uncertainty) < 0.1
    job(f"calibrate {take}")
    pressure = midair.calibrate(*opened(take))
    assert pressure.pressure.shape == (600, 4, 4)
    assert 10 < pressure.pressure.max() < 100


@pytest.mark.long
def test_solve(take, job):
    found = job(f"solve {take} best.drive.h5 {COARSE} --duration 50ms --json")
    assert found["E_mean"] < 0.01
    assert found["rate_hz"] == pytest.approx(4000 / 3)
    assert 20 < found["level"]["peak_pa"] < 200
    drive = midair.load("best.drive.h5").drive
    assert drive.phase.shape == (found["frames"], 996)
    paper = job(f"solve {take} paper.drive.h5 --mode paper --start-at 0.45s --duration 10ms --lead 0s --json")
    assert (paper["frames"], paper["rate_hz"]) == (10, 1000)
    assert 0.005 < paper["E_mean"] < 0.15


@pytest.mark.long
def test_play(drive, job):
    """The sensor in the palm's place reads about the pressure that the drive was solved for."""
    job(f"play {drive} --output felt.h5")
    heard = midair.load("felt.h5")
    assert heard.provenance.simulated
    pressure = midair.calibrate(*opened("felt.h5"))
    assert 5 < pressure.pressure.max() < 60


@pytest.mark.long
def test_compare(take, drive, job):
    job(f"play {drive} --output heard.h5")
    found = figures(job(f"compare {take} heard.h5 --report heard.html --json"))
    assert found["correlation"] > 0.9
    assert 0.5 < found["gain"] < 1.5
    assert found["signal to distortion"] > 5
    assert "<html" in Path("heard.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_loop(take, job):
    """The second pass is corrected by what the sensor read of the first."""
    grid = midair.ControlGrid(rows=8, columns=8, pitch=22e-3 / 3, height=0.2)
    settings = quick_mode().but(grid=grid, guard=None, fit="points")
    loop = midair.loop(take, settings, lead=0.02)
    first, last = (one.comparison for one in loop.passes)
    assert abs(first.gain - 1) < 0.3
    assert abs(last.gain - 1) < 0.05
    assert last.correlation > 0.9


@pytest.mark.long
def test_exposure_refusal_and_stop(take, job, monkeypatch):
    """A loud drive is refused on an array; attenuated it plays, until another process stops it."""
    pytest.importorskip("autd3")
    monkeypatch.setenv("MIDAIR_STATE", str(Path("state").resolve()))
    unit = midair.TransducerArray.autd3(columns=1, rows=1)
    pressure = midair.calibrate(*opened(take)).cut(0.45, 0.05)
    save_solution(midair.solve(midair.prepare(pressure, mapping="half-wave"), unit, method="fast"), "loud.drive.h5")
    Path("unit.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n', encoding="utf-8")
    found = job("exposure loud.drive.h5 --json")
    assert not found["kept"]
    assert 10 < found["excess_db"] < 50
    assert found["places"]["left ear"]["peak_db"] <= 110 + found["excess_db"] + 0.1
    words = "play loud.drive.h5 --device autd3:emulator --placement unit.toml"
    job(words, status=1)
    assert not Path("state/played.jsonl").exists()
    command = [sys.executable, "-m", "midair", *words.split(), "--attenuate", "--repeats", "1000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as player:
        wait_until(Path("state/played.jsonl").exists)
        time.sleep(0.2)
        (stopped,) = job("stop --json")
        player.communicate(timeout=60)
    assert stopped["outcome"] == "silent"
    assert player.returncode in (1, 130)
    assert job("stop --json") == []


@pytest.mark.long
def test_live(job):
    found = job("live --sensor virtual:towel --duration 0.3s --keep live.h5 --json")
    assert found["frames"] == 300
    assert found["played"] > 100
    assert found["latency"] == pytest.approx(13, abs=0.2)
    kept = midair.load("live.h5")
    assert (kept.rate, kept.frames >= found["frames"]) == (1000, True)


@pytest.mark.long
def test_study_session_and_report(job):
    job("study new threshold --template detection --drives none --participants 1 --seed 1")
    job("study run threshold --simulate")
    found = job("study analyse threshold --draws 200 --json")
    assert found["simulated"]
    tables = {one["title"]: one["table"] for one in found["findings"]}
    (row,) = tables["Thresholds of adaptive blocks"]
    assert row["low"] < row["threshold"] < row["high"]
    assert row["trials"] > 100
    assert (Path("threshold") / "report.html").stat().st_size > 10_000
    job("study export threshold answers.csv --format csv")
    assert len(Path("answers.csv").read_text(encoding="utf-8").splitlines()) > row["trials"]


@pytest.mark.long
def test_sweep(take, job):
    words = "--vary height=150mm,200mm --start-at 0.45s --duration 5ms --mode paper --method fast --workers 1"
    job(f"sweep recordings heights.sweep {take} {words}")
    found = job("sweep report heights.sweep --json")
    low, high = found["trials"]
    assert (low["frames"], high["frames"]) == (5, 5)
    assert 0.01 < low["mean"] < low["worst"] < 0.3
    assert 0.01 < high["mean"] < high["worst"] < 0.3
    # What is done is not solved again.
    job(f"sweep recordings heights.sweep {take} {words}")
    assert job("sweep report heights.sweep --json")["trials"] == found["trials"]
