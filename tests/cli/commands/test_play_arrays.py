import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.drives import log, save_drive
from tests.model.test_calibration import calibration
from tests.simulators.udp_proxy import UdpProxy
from tests.waiting import wait_until

from midair.cli import run
from midair.devices import PlayReport
from midair.model import Provenance, TransducerArray
from midair.rig import keep_array_calibration, session

pytest.importorskip("autd3")
pytestmark = pytest.mark.usefixtures("own_state")
EMULATOR = ["--device", "autd3:emulator"]
NOWHERE = f"autd3:nowhere{os.getpid()}"
"""An interface of this run alone, since a lock holds for the whole computer."""
ARRAY = TransducerArray.autd3()
SWITCH, SILENCE = 0x12, 0x16


def make(name, level=0.008, frames=20, rate=1000.0, array=ARRAY):
    rng = np.random.default_rng(0)
    phase, solved = rng.uniform(0, 6, (frames, array.count)), {"array_calibration": array.calibration_id}
    life = Provenance().then("solve", solved)
    return save_drive(name, phase, level, rate=rate, array=array, provenance=life)


def said(capsys, captured=None):
    return [line for line in (captured or capsys.readouterr()).err.splitlines() if line.startswith("midair: ")]


@pytest.mark.long
def test_a_quiet_drive_plays_with_a_timing_report(capsys):
    assert run(["play", make("a.drive.h5"), *EMULATOR, "--repeats", "2", "--delay", "5ms", "--all"]) == 0
    printed = capsys.readouterr().out
    words = "played 0.04 s on autd3:emulator", "every frame in time", "ns of device time", "silencer", "SIMULATED"
    assert [each for each in words if each not in printed] == []
    assert ([entry["event"] for entry in log()], log()[1]["reason"]) == (["play", "end"], "played")
    assert list(Path("state").glob("playing-*")) == []


@pytest.mark.long
def test_a_play_with_gaps_begins_with_them_and_ends_with_status_1(capsys, monkeypatch):
    """Before, 543 ms of silence in 600 ms of touch were one row of many, with exit status 0."""
    found = PlayReport(frames=2400, duration=0.6, gap=0.543, late=1000)
    monkeypatch.setattr(session.Session, "_sound", lambda *_, **__: found)
    assert run(["play", make("a.drive.h5"), *EMULATOR]) == 1
    printed = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert "SIMULATED the touch was broken: 543 ms of silence in 600 ms of touch, since this computer" in printed
    assert "timing 1000 late, 0 repeated, 543 ms of gaps, of 2400 frames" in printed
    assert "120 ms of frames that came too late in 600 ms" in replace(found, gap=0.0, late=480).broken
    assert replace(found, gap=0.05).broken == replace(found, gap=0.0, late=200).broken == ""


@pytest.mark.long
def test_play_recommends_a_check_and_warns_of_a_drive_for_the_model(capsys):
    known = calibration(ARRAY)
    keep_array_calibration("autd3:emulator", known)
    assert run(["play", make("a.drive.h5", frames=20), *EMULATOR]) == 0
    assert "solved without that of this array" in capsys.readouterr().err
    assert run(["play", make("b.drive.h5", frames=20, array=known.applied(ARRAY)), *EMULATOR]) == 0
    told = re.sub(r"\s+", " ", capsys.readouterr().err)
    assert "not checked today: midair calibrate array SENSOR --device autd3:emulator --check" in told
    assert "solved without" not in told


def test_a_loud_drive_is_refused_before_the_device_is_opened(capsys):
    assert run(["play", make("loud.drive.h5", level=1.0), "--device", NOWHERE]) == 1
    (line,) = said(capsys)
    assert [word for word in ("dB at the", "limit 110 dB", "--override-exposure") if word not in line] == []
    assert list(Path("state").glob("*")) == []


@pytest.mark.long
def test_an_override_and_the_air_of_the_room_stay_in_the_log():
    stated = ["--override-exposure", "A Person", "--temperature", "24C"]
    assert run(["play", make("loud.drive.h5", level=1.0), *EMULATOR, *stated]) == 0
    begun = log()[0]
    assert (begun["room"], begun["override_by"]) == ({"temperature_c": 24.0, "humidity": 0.5}, "A Person")
    assert begun["excess_db"] > 10


def test_forbidden_drives_do_not_play(capsys):
    truncated = Path(make("truncated.drive.h5")).read_bytes()
    Path("truncated.drive.h5").write_bytes(truncated[: len(truncated) // 2])
    with h5py.File(make("nan.drive.h5"), "a") as file:
        file["level"][3] = np.nan
    make("other.drive.h5", array=TransducerArray.autd3(columns=1, rows=1))
    make("rate.drive.h5", rate=900.0)
    words = {"truncated": "truncated.drive.h5", "nan": "nan", "other": "solve the target again", "rate": "40 kHz / N"}
    for name, word in words.items():
        capsys.readouterr()
        assert run(["play", f"{name}.drive.h5", *EMULATOR]) == 1
        (line,) = said(capsys)
        assert word in line
        assert not Path("state/played.jsonl").exists() or log()[-1]["event"] == "end"


@pytest.mark.long
def test_exposure_prints_and_draws_and_virtual_devices_only_tell(capsys):
    make("loud.drive.h5", level=1.0)
    assert run(["exposure", "loud.drive.h5", "--figure", "loud.exposure.png"]) == 0
    page = " ".join(capsys.readouterr().out.split())
    assert "left ear" in page
    assert "too loud" in page
    assert Path("loud.exposure.png").stat().st_size > 10_000
    assert run(["exposure", "loud.drive.h5", "--figure", "loud.exposure.png"]) == 1
    assert "--force" in said(capsys)[0]
    assert run(["play", "loud.drive.h5"]) == 0
    assert "on a real array " in " ".join(capsys.readouterr().out.split())


@pytest.mark.long
def test_exposure_in_the_air_of_the_room(answer):
    """Cold dry air takes less from the sound than a damp room; with nothing stated, the least attenuation counts."""
    make("a.drive.h5", level=0.003)
    unknown, room, cold = (
        answer("exposure", "a.drive.h5", *words.split())["excess_db"]
        for words in ("", "--temperature 22C --humidity 60%", "--temperature 0C --humidity 10%")
    )
    assert min(unknown, cold) > room + 0.1


@pytest.mark.long
@pytest.mark.parametrize("cause", ["byte", "hang-up"])
@pytest.mark.parametrize("by", ["play", "stop --watch"])
def test_a_hardware_stop_silences_what_plays(cause, by):
    """A pseudo terminal in place of a serial port; the other end sends a byte or hangs up."""
    master, slave = os.openpty()
    line = f"serial:{os.ttyname(slave)}"
    midair = [sys.executable, "-c", "from midair.cli import main; main()"]
    play = [*midair, "play", make("a.drive.h5", frames=200), *EMULATOR, "--repeats", "500"]
    watch = None if by == "play" else subprocess.Popen([*midair, "stop", "--watch", line], stderr=-1, text=True)
    if watch is not None:
        assert "watching" in watch.stderr.readline()
    with subprocess.Popen([*play, *(["--stop-input", line] if by == "play" else [])], stdout=-1, stderr=-1) as player:
        wait_until(Path("state/played.jsonl").exists)
        time.sleep(0.3)
        os.close(slave)
        began = datetime.now(UTC)
        os.write(master, b"s") if cause == "byte" else os.close(master)
        player.communicate(timeout=60)
    assert player.returncode in (1, 130)
    end = log()[-1]
    assert (end["event"], end["outcome"], end["reason"]) == ("end", "stopped", "midair stop")
    took = (datetime.fromisoformat(end["time"]) - began).total_seconds()
    print(f"{by}, {cause}: end of the order logged after {1e3 * took:.0f} ms")
    assert took < 10
    if cause == "byte":
        os.close(master)
    if watch is not None:
        assert watch.wait(60) == 1
        assert "it was lost, and all arrays were stopped" in watch.stderr.read()
        watch.stderr.close()


def test_nothing_plays_without_its_hardware_stop(capsys):
    play = ["play", make("a.drive.h5"), *EMULATOR]
    for words in (play, ["live", "--device", "autd3:emulator"], ["studio", "--no-browser"]):
        assert run([*words, "--stop-input", "serial:/dev/none"]) == 1
        assert "nothing plays without it" in said(capsys)[0], words
        assert not Path("state/played.jsonl").exists()


def test_stop_reports_what_it_could_not_stop(capsys):
    """A process that holds a player's file and does not answer."""
    assert run(["stop"]) == 0
    assert "no running playback" in capsys.readouterr().out
    Path("state").mkdir(exist_ok=True)
    holder = "import fcntl, time; file = open('state/playing-7.json', 'w'); fcntl.flock(file, fcntl.LOCK_EX)"
    command = [sys.executable, "-c", f"{holder}; print(1, flush=True); time.sleep(60)"]
    with subprocess.Popen(command, stdout=-1) as process:
        process.stdout.readline()
        assert run(["stop"]) == 1
        assert run(["stop", "--json"]) == 1
        process.kill()
        process.communicate()
    page, _, document = " ".join(capsys.readouterr().out.split()).partition("[ {")
    assert "NOT KNOWN TO BE SILENT" in page
    assert "switch the units off" in page
    assert '"outcome": "no answer"' in document
    assert run(["stop"]) == 0


@pytest.mark.long
def test_a_second_play_on_the_same_array_names_the_first(capsys, request):
    tap = UdpProxy(1)
    request.addfinalizer(tap.close)
    make("a.drive.h5", frames=200, array=TransducerArray.autd3(columns=1, rows=1))
    Path("one.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n', encoding="utf-8")
    play = ["play", "a.drive.h5", "--placement", "one.toml", "--device", f"autd3:{tap.address}"]
    command = [sys.executable, "-c", "from midair.cli import main; main()", *play, "--repeats", "500"]
    with subprocess.Popen(command, stdout=-1, stderr=-1) as first:
        while not list(Path("state").glob("device-*")):
            time.sleep(0.05)
        assert run(play) == 1
        (line,) = said(capsys)
        assert f"process {first.pid} (-c play a.drive.h5" in line
        assert "has had it since 20" in line
        run(["stop"])
        first.communicate(timeout=30)
    assert run([*play, "--attenuate"]) == 0


def test_what_cannot_be_stopped_does_not_play(capsys):
    Path("state").write_text("no folder", encoding="utf-8")
    assert run(["play", make("a.drive.h5"), *EMULATOR]) == 1
    (line,) = said(capsys)
    assert "set MIDAIR_STATE" in line


@pytest.mark.long
def test_a_computer_that_stands_still_for_a_second_ends_the_play_with_status_1_and_the_silent_frames(tap):
    make("three.drive.h5", level=0.005, frames=3000)
    command = [sys.executable, "-c", "from midair.cli import main; main()", "play", "three.drive.h5"]
    with subprocess.Popen(
        [*command, "--device", f"autd3:{tap.address}"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as player:
        # The first switch: it is about to sound.
        while player.poll() is None and not any(frame[2] == SWITCH for frame in tap.frames()):
            time.sleep(0.02)
        time.sleep(0.4)
        player.send_signal(signal.SIGSTOP)
        time.sleep(1)
        player.send_signal(signal.SIGCONT)
        _, error = player.communicate(timeout=30)
    assert player.returncode == 1
    (line,) = [line for line in error.splitlines() if line.startswith("midair: ")]
    assert re.search(
        r"failsafe silenced units? [\d, ]+: frames \d+ to 2999 of 3000 \([\d.]+ to 3\.000 s\) were silent", line
    )
    assert log()[-1]["reason"].startswith("SilentFramesError")


@pytest.mark.long
def test_units_that_are_too_hot_end_the_play_with_status_1_and_the_log_says_why(tap, capsys):
    """From 400 ms after the first switch on."""
    make("three.drive.h5", level=0.005, frames=3000)
    status = []
    player = threading.Thread(
        target=lambda: status.append(run(["play", "three.drive.h5", "--device", f"autd3:{tap.address}"]))
    )
    player.start()
    while player.is_alive() and not any(frame[2] == SWITCH for frame in tap.frames()):
        time.sleep(0.02)
    time.sleep(0.4)
    tap.hot = range(65536)
    player.join(30)
    (line,) = said(capsys)
    words = r"after \d+ of 3000 frames \([\d.]+ s\)"
    assert re.search(rf"units 0, 1, 2, 3 too hot {words}; let them cool, then use a lower --level or pauses$", line)
    assert (status, (log()[-1]["event"], log()[-1]["outcome"])) == ([1], ("end", "failed"))
    assert log()[-1]["reason"] == f"TooHotError: {line.removeprefix('midair: ')}"
    last = tap.frames()[-1][3]
    assert (last[5], any(last[-249:])) == (SILENCE, False)


def play_until_it_pauses(tap, *more):
    """A play that waits for hot units, started in a thread and paused in mid-play; its statuses."""
    make("three.drive.h5", level=0.005, frames=800)
    status = []
    command = ["play", "three.drive.h5", "--device", f"autd3:{tap.address}", "--when-hot", "wait", *more]
    player = threading.Thread(target=lambda: status.append(run(command)))
    player.start()
    wait_until(lambda: any(frame[2] == SWITCH for frame in tap.frames()), 120)
    tap.hot = range(65536)
    wait_until(lambda: Path("state/played.jsonl").exists() and log()[-1]["event"] != "play", 120)
    return player, status


@pytest.mark.long
def test_a_play_that_waits_for_hot_units_ends_with_status_0_and_the_log_holds_the_pause(tap, capsys):
    player, status = play_until_it_pauses(tap)
    assert log()[-1]["event"] == "pause"
    assert run(["play", "three.drive.h5", "--device", f"autd3:{tap.address}"]) == 1, "others stay locked out"
    tap.hot = ()
    player.join(60)
    assert status == [0]
    captured = capsys.readouterr()
    told = [line for line in captured.err.splitlines() if line.startswith("midair: ")]
    assert "units 0, 1, 2, 3 too hot" in told[0]
    assert told[-1].startswith("midair: units have cooled; playback continues after a pause of ")
    assert re.search(r"paused +[\d.]+ s in silence, since units were too hot", captured.out)
    mine = [entry for entry in log() if entry["order"] == log()[0]["order"]]
    assert [entry["event"] for entry in mine] == ["play", "pause", "continue", "end"]
    assert mine[1]["reason"].startswith("TooHotError: array: expected units that are not too hot, got units 0, 1, 2, 3")
    assert mine[3]["outcome"] == "played"
    assert mine[3]["paused_s"] > 1.0


@pytest.mark.long
def test_midair_stop_ends_a_play_that_waits_for_hot_units(tap):
    player, status = play_until_it_pauses(tap)
    assert run(["stop"]) == 0
    player.join(60)
    assert (status, [entry["event"] for entry in log()]) == ([1], ["play", "pause", "end"])
    assert log()[-1]["outcome"] == "stopped"
    assert not any(tap.frames()[-1][3][-249:])


@pytest.mark.long
def test_a_play_that_waits_too_long_for_hot_units_ends_with_status_1(tap, capsys):
    player, status = play_until_it_pauses(tap, "--cooling-limit", "500ms")
    player.join(60)
    assert status == [1]
    assert "no second without heat in a pause of 0.5 s; let them cool" in said(capsys)[-1]
    assert (log()[-1]["event"], log()[-1]["outcome"]) == ("end", "failed")


TILTED = 'name = "one tilted"\n[[unit]]\nposition_mm = [0, 0, 0]\nrotation_deg = [0, -30, 0]'


@pytest.mark.long
def test_a_drive_for_a_placement_plays_there_and_nowhere_else(capsys):
    Path("tilted.toml").write_text(TILTED, encoding="utf-8")
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.3s"]) == 0
    part = shlex.split(
        "--set target.grid={rows=6,columns=6,pitch=0.011} --start-at 0.1s --duration 0.02s --set solver.level=0.01"
    )
    assert run(["solve", "take.h5", *part, "--mode", "paper", "--method", "fast", "--placement", "tilted.toml"]) == 0
    assert "one tilted, 249 transducers" in capsys.readouterr().out
    assert run(["play", "take.drive.h5", *EMULATOR]) == 1
    assert "solve the target again" in said(capsys)[0]
    assert run(["play", "take.drive.h5", *EMULATOR, "--placement", "tilted.toml"]) == 0


@pytest.mark.long
def test_the_strength_in_a_file_changes_no_exposure(capsys, answer):
    """A file that claims transducers of a millionth is measured as those of the device are, and the claim is told."""
    claims = replace(ARRAY, pressure=1e-6)
    honest = answer("exposure", make("honest.drive.h5"))
    claimed = answer("exposure", make("claims.drive.h5", array=claims))
    assert honest["places"] == claimed["places"]
    assert claimed["file_transducer_pa_m"] == pytest.approx(1e-6)
    assert run(["exposure", "claims.drive.h5", *EMULATOR, "--all"]) == 0
    page = " ".join(capsys.readouterr().out.split())
    assert "the file states 1e-06 Pa m, which is ignored" in page


@pytest.mark.long
def test_a_drive_too_weak_to_feel_is_reported(capsys):
    focus = make("loud.drive.h5", level=1.0)
    assert run(["play", focus, *EMULATOR]) == 1
    assert "and nothing will be felt), --ear-protection counts" in said(capsys)[0]
    assert run(["play", focus, *EMULATOR, "--attenuate"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert re.search(r"nothing will be felt: \S+ of the \S+ Pa that one of 20 people feels", shown)
    assert "felt by about 0 of 10 people" in shown or "felt by" not in shown


@pytest.mark.long
def test_a_refusal_prints_four_ways_and_a_plan_what_quiet_ears_give(capsys):
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.6s"]) == 0
    part = ["--start-at", "0.5s", "--duration", "20ms", "--set", "target.grid={rows=6,columns=6,pitch=0.011}"]
    assert run(["solve", "take.h5", *part, "--mode", "quick"]) == 0
    capsys.readouterr()
    assert run(["play", "take.drive.h5", *EMULATOR]) == 1
    refused = capsys.readouterr()
    assert re.fullmatch(
        r"midair: not played: \d+\.\d dB too loud: .* dB at the .*, limit 110 dB", said(capsys, refused)[0]
    )
    names = ["protect all ears in the room", "solve for quiet ears", "play it weaker", "answer for it by name"]
    ways = {name: line for line in refused.out.splitlines() for name in names if line.startswith(name)}
    assert list(ways) == names
    assert "see --plan" in ways[names[1]]
    before = set(Path().iterdir())
    assert run(["play", "--plan", "take.h5", *part, "--mode", "quick"]) == 0
    planned = capsys.readouterr().out
    assert planned.startswith("SIMULATED  nothing was played; ")
    assert re.search(r"solve for quiet ears +\d+ of 10 +midair solve take.h5 --mode quiet\n", planned)
    # The same figures as in the refusal, and nothing was written.
    for name in (names[0], *names[2:]):
        assert re.sub(" +", " ", ways[name]) in re.sub(" +", " ", planned)
    assert set(Path().iterdir()) == before
    assert run(["play", "--plan", "take.drive.h5"]) == 1
    assert "expected a recording" in said(capsys)[0]


@pytest.mark.long
def test_ctrl_c_again_and_again_is_one_line_and_silence(tap):
    """Before, a Ctrl-C in the exit of the program printed a traceback."""
    words = ["play", make("a.drive.h5", frames=2000), "--device", f"autd3:{tap.address}", "--repeats", "100"]
    command = [sys.executable, "-m", "midair", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_until(lambda: any(frame[2] == SWITCH for frame in tap.frames()) or process.poll() is not None)
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
            time.sleep(0.005)
        printed = process.stderr.read()
    assert process.returncode == 130, printed
    assert "Traceback" not in printed
    assert printed.count("midair: stopped") == 1
    assert [command for _, _, command, _ in tap.frames() if command in (SWITCH, SILENCE)][-1] == SILENCE
