"""`midair log export` after real plays: one to its end, one killed."""

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.drives import save_drive
from tests.waiting import wait_until

from midair.cli import run
from midair.model import TransducerArray

pytest.importorskip("autd3")
pytestmark = pytest.mark.usefixtures("own_state")
EMULATOR = ["--device", "autd3:emulator"]
ARRAY = TransducerArray.autd3()


def make(name, frames=200):
    phase = np.random.default_rng(0).uniform(0, 6, (frames, ARRAY.count))
    return save_drive(name, phase, 0.008)


def exported(*options):
    assert run(["log", "export", "--force", *options]) == 0
    with Path("dose.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.long
def test_a_play_is_exported_with_its_participant(capsys):
    assert run(["play", make("a.drive.h5"), *EMULATOR, "--participant", "P07"]) == 0
    row, day = exported("--participant", "P07")
    assert (row["row"], row["participant"], row["end"], row["device"]) == ("order", "P07", "played", "autd3:emulator")
    assert (row["simulated"], row["duration_s"], row["duration_is"]) == ("True", "0.2", "measured")
    assert len(row["file_sha256"]) == 64
    assert 0 < float(row["palm_pa"]) < 1
    assert float(row["level"]) == 0.008
    assert float(row["left_ear_8h_db"]) < float(row["left_ear_peak_db"]) < 110
    assert (day["row"], day["orders"]) == ("day", "1")
    assert "SIMULATED" in Path("dose.html").read_text(encoding="utf-8")
    assert run(["log", "export"]) == 1
    assert "--force" in capsys.readouterr().err


@pytest.mark.long
def test_a_killed_play_is_exported_without_an_end(capsys):
    play = ["play", make("a.drive.h5"), *EMULATOR, "--participant", "P07"]
    command = [sys.executable, "-c", "from midair.cli import main; main()", *play, "--repeats", "500"]
    log = Path("state/played.jsonl")
    with subprocess.Popen(command, stdout=-1, stderr=-1) as player:
        wait_until(log.exists)
        row, _ = exported()
        assert row["end"] == "playing"
        player.send_signal(signal.SIGKILL)
        player.communicate()
    capsys.readouterr()
    assert run(["log", "export", "--force", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    (row,), (day,) = document["orders"], document["days"]
    assert (row["end"], row["participant"], row["duration_s"]) == ("unknown", "P07", 100.0)
    assert (day["without_end"], day["duration_is"]) == (1, "at most")
