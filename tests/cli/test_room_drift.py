"""Commands that play warn while the room becomes warmer, end to end: a program rewrites a file thermometer."""

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from tests.drives import plan_of, save_drive

from midair.cli import run
from midair.model import Acoustics, Medium, TransducerArray

ARRAY = TransducerArray.autd3()
ROOM = ["--temperature", "file:room.txt"]
DRIFTED = "air: file:room.txt measures 23.5 °C, the drive was solved for 22.0 °C; "


@pytest.fixture(autouse=True)
def _thermometer(own_state):
    Path("room.txt").write_text("22.0\n", encoding="utf-8")


def run_in_a_room_that_warms(words, until=""):
    """Exit status and lines on stderr; the room warms after the command has read it.

    If `until` is given, its input ends after a line with these words.
    """
    command = [sys.executable, "-m", "midair", *words, *ROOM]
    lines = []
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "COLUMNS": "300"},
        encoding="utf-8",
    ) as running:
        limit = threading.Timer(300, running.kill)
        limit.start()
        for line in running.stderr:
            lines.append(line.strip())
            if "air: file:room.txt measures 22 °C" in line:
                Path("room.txt").write_text("23.5\n", encoding="utf-8")
            if until and until in line:
                running.stdin.close()
        status = running.wait()
        limit.cancel()
    return status, lines


def logged_drifts():
    """Events "air" of the log of playback: device, measured and solved temperature."""
    entries = map(json.loads, Path("state/played.jsonl").read_text(encoding="utf-8").splitlines())
    return [(each["device"], each["measured_c"], each["solved_c"]) for each in entries if each["event"] == "air"]


@pytest.mark.long
def test_live_on_emulated_units_warns_once_and_logs_it():
    pytest.importorskip("autd3")
    words = ["live", "--sensor", "virtual:brush", "--device", "autd3:emulator", "--level", "0.1", "--duration", "3s"]
    status, lines = run_in_a_room_that_warms([*words, "--override-exposure", "a test"])
    assert status == 0, lines
    assert [line.removeprefix("midair: ") for line in lines if DRIFTED in line] == [
        f"{DRIFTED}start live again to solve for this air"
    ]
    assert logged_drifts() == [("autd3:emulator", 23.5, 22.0)]


@pytest.mark.long
def test_a_loop_on_the_virtual_rig_warns_once_and_logs_nothing():
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.3s"]) == 0
    part = ["--mode", "paper", "--points", "6", "--pitch", "11mm", "--method", "fast", "--duration", "0.08s"]
    status, lines = run_in_a_room_that_warms(["loop", "take.h5", "report.html", *part])
    assert status == 0, lines
    assert [line.removeprefix("midair: ") for line in lines if DRIFTED in line] == [
        f"{DRIFTED}run the loop again for this air"
    ]
    assert not Path("state/played.jsonl").exists()


@pytest.mark.long
def test_a_study_on_emulated_units_warns_once_and_logs_it():
    pytest.importorskip("autd3")
    room = Acoustics(medium=Medium.at(temperature=22.0))
    save_drive("quiet.drive.h5", acoustics=room)
    Path("plan.toml").write_text(plan_of("quiet.drive.h5"), encoding="utf-8")
    assert run(["study", "new", "s", "--source", "plan.toml"]) == 0
    words = ["study", "run", "s", "--participant", "1", "--array", "autd3:emulator", "--noise", "none", "--lines"]
    status, lines = run_in_a_room_that_warms(words, until=DRIFTED)
    assert status == 1, "its input ended"
    assert "the answers so far are stored" in lines[-1]
    assert [line.removeprefix("midair: ") for line in lines if DRIFTED in line] == [
        f"{DRIFTED}solve the drives again for this air"
    ]
    assert logged_drifts() == [("autd3:emulator", 23.5, 22.0)]
