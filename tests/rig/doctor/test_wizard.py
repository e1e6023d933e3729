"""The first-day check of an array: by a person on the makers' emulator."""

import io
import json
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from tests.drives import log, save_drive
from tests.waiting import wait_until

from midair.cli import run
from midair.devices import state_folder
from midair.model import Acoustics, Placement
from midair.rig import checkup_line
from midair.rig.doctor.wizard import click_drive

WIZARD = ["doctor", "--device", "autd3:emulator", "--wizard"]
SWITCH, SILENCE = 0x12, 0x16


def stored(name="autd3:emulator"):
    path = state_folder() / f"checkup-{name.replace(':', '%3A')}.json"
    return {each["subject"]: each for each in json.loads(path.read_text(encoding="utf-8"))["checks"]}


def answered(monkeypatch, text):
    pytest.importorskip("autd3")
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    return run(WIZARD)


@pytest.mark.long
def test_a_person_confirms_a_sound_array(monkeypatch, capsys):
    assert answered(monkeypatch, "warm\n22.5\ny\n0\nr\n1\nx\n2\n3\n") == 0
    found = stored()
    assert found["air"]["found"].startswith("22.5 °C")
    assert [found[each]["state"] for each in ("placement", "ears", "wiring", "heat")] == ["ok"] * 4
    # One order a click; unit 1 clicked twice.
    played = [entry["drive"] for entry in log() if entry["event"] == "play"]
    assert played == [f"clicks of unit {unit}" for unit in (0, 1, 1, 2, 3)]
    assert "report stored" in capsys.readouterr().err
    assert "hours ago: 0 of" in checkup_line("autd3:emulator")


@pytest.mark.long
def test_swapped_and_silent_units_are_named(monkeypatch):
    assert answered(monkeypatch, "\nn\n1\n0\n2\nn\n") == 1
    found = stored()
    assert found["air"]["state"] == "missing"
    assert found["placement"]["state"] == "broken"
    assert found["wiring"]["found"] == (
        "commands for unit 0 sound from the place of 1, commands for unit 1 sound from the place of 0, "
        "the place of unit 3 was not found"
    )


@pytest.mark.long
def test_without_a_person_nothing_is_confirmed(capsys):
    pytest.importorskip("autd3")
    assert run([*WIZARD, "--yes", "--temperature", "21C"]) == 0
    found = stored()
    assert found["air"]["state"] == "ok"
    assert [found[each]["state"] for each in ("placement", "wiring")] == ["missing"] * 2
    assert "not confirmed" in found["wiring"]["found"]


@pytest.mark.long
def test_the_end_of_the_answers_stores_no_report(monkeypatch, capsys):
    assert answered(monkeypatch, "22\ny\n") == 1
    assert "the end of the input; no report was stored; without a person: --yes" in capsys.readouterr().err
    assert list(state_folder().glob("checkup-*")) == []
    assert checkup_line("autd3:emulator") == 'never: midair doctor --device "autd3:emulator" --wizard'
    assert checkup_line("pyautd3:ethercrab", "pyautd3") == 'never: midair doctor --device "pyautd3" --wizard'


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_abort_in_a_click_leaves_silence(number, tap):
    words = [sys.executable, "-m", "midair", "doctor", "--device", f"autd3:{tap.address}", "--wizard"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdin.write("22\ny\n")
        process.stdin.flush()
        wait_until(lambda: any(command == SWITCH for _, _, command, _ in tap.frames()))
        process.send_signal(number)
        process.communicate(timeout=60)
    assert process.returncode != 0
    time.sleep(1.0)  # the failsafe of the units, after SIGKILL
    commands = [command for _, _, command, _ in tap.frames() if command in (SWITCH, SILENCE)]
    assert commands[-1] == SILENCE or number == signal.SIGKILL
    assert all(state & 0x80 for state in tap.states())
    assert list(state_folder().glob("checkup-*")) == []


@pytest.mark.long
def test_play_prints_the_age_of_the_report(tmp_path, monkeypatch, capsys):
    pytest.importorskip("autd3")
    monkeypatch.chdir(tmp_path)
    array = Placement.grid().array()
    save_drive("quiet.drive.h5", level=0.004, array=array)
    play = ["play", "quiet.drive.h5", "--device", "autd3:emulator"]
    assert run(play) == 0
    assert "checkup never: midair doctor" in " ".join(capsys.readouterr().out.split())
    old = datetime.now(UTC) - timedelta(days=3, hours=1)
    report = {"time": old.isoformat(), "checks": [{"state": "ok"}, {"state": "broken"}, {"state": "missing"}]}
    path = state_folder() / "checkup-autd3%3Aemulator.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    assert run(play) == 0
    assert "3 days ago: 1 of 3 broken, 1 not checked" in " ".join(capsys.readouterr().out.split())
    path.write_text("[", encoding="utf-8")
    assert checkup_line("autd3:emulator").startswith("unreadable")


def test_a_click_is_of_one_unit_and_above_its_centre():
    array = Placement.grid().array()
    drive = click_drive(array, 2, height=0.2, acoustics=Acoustics())
    assert set(np.flatnonzero(drive.level.any(axis=0))) == set(np.flatnonzero(array.unit == 2))
    assert drive.level[0].max() == 1
    assert not drive.level[-1].any()
    # Five bursts, each of ten periods of 8 ms.
    sounds = np.asarray(drive.level.any(axis=1))
    assert np.count_nonzero(np.diff(sounds.astype(int)) == 1) + sounds[0] == 50
    # Equal paths: at the focus all phases agree.
    inside = array.unit == 2
    focus = array.position[inside].mean(axis=0) + np.array([0, 0, 0.2])
    path = np.linalg.norm(array.position[inside] - focus, axis=1)
    turn = np.exp(1j * (drive.phase[0, inside] + 2 * np.pi * 40e3 / 340 * path))
    np.testing.assert_allclose(turn, turn[0], atol=1e-6)
