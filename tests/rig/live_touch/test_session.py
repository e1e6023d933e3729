"""Live touch in its own process: from a virtual sensor to emulated units and into a take."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from tests.drives import log
from tests.waiting import wait_until

import midair
from midair.devices import ExposureChoices, stop_on_input, stop_playing
from midair.errors import DeviceError, ExposureError, InputError, StoppedError, UnknownDeviceError
from midair.files import DEFAULT_PROFILE, load_played, open_take, profile_named

ANSWERED = ExposureChoices(profile=profile_named(DEFAULT_PROFILE), override="a test")


def test_keywords_change_the_settings_and_none_restores_a_default():
    settings = midair.rig.LiveSettings(height=0.15, gain=2.0)
    assert midair.live(settings=settings, gain=None, seed=3).order == midair.rig.LiveSettings(height=0.15, seed=3)
    assert midair.live("virtual:brush", settings=settings).order.sensor == "virtual:brush"
    with pytest.raises(InputError, match="hight"):
        midair.live(hight=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        ({"sensor": "nothing"}, UnknownDeviceError, "expected virtual:OBJECT"),
        ({"device": "pyautd3:nop"}, UnknownDeviceError, "accept single frames"),
        ({"device": "autd3:emulator"}, ExposureError, "takes responsibility"),
    ],
)
def test_errors_of_the_process_are_raised_here(wrong, error, words):
    with pytest.raises(error, match=words), midair.live(**wrong):
        pass


@pytest.mark.slow
def test_a_take_holds_all_samples_and_all_emitted_frames(tmp_path):
    path = tmp_path / "felt.h5"
    with midair.live("virtual:towel", "autd3:emulator", exposure=ANSWERED, duration=3.0, keep=path) as session:
        session.wait()
    told, kept, played = session.statistics, open_take(path), load_played(path)
    assert told.frames == kept.recording.frames == played.frames == 3000
    assert told.lost == 0
    assert told.latency == pytest.approx(0.013, abs=1e-4)
    # The sensor's own round but for its noise, without a break.
    once = midair.record("virtual:towel", 3.0).recording.samples
    assert kept.recording.samples == pytest.approx(once, abs=1e-3)
    assert kept.recording.provenance.simulated
    sounded = (played.state & 1) > 0
    assert sounded.sum() == pytest.approx(told.played, abs=told.late)
    # The level rises in the first second.
    assert played.intensity[sounded][:20].max() < 60
    assert played.intensity[2000:].max() == 255


@pytest.mark.slow
def test_midair_stop_silences_it():
    with pytest.raises(StoppedError), midair.live("virtual:brush", "autd3:emulator", exposure=ANSWERED) as session:
        session.wait(1.0)
        (stopped,) = stop_playing()
        assert stopped.outcome == "silent"
        session.wait(5.0)


@pytest.mark.long
def test_a_hardware_stop_silences_it():
    master, slave = os.openpty()
    try:
        with (
            stop_on_input(f"serial:{os.ttyname(slave)}"),
            pytest.raises(StoppedError),
            midair.live("virtual:brush", "autd3:emulator", exposure=ANSWERED, participant="P1") as session,
        ):
            session.wait(1.0)
            os.write(master, b"s")
            session.wait(10.0)
    finally:
        os.close(slave)
        os.close(master)
    order, end = log()
    assert (order["participant"], end["outcome"], end["reason"]) == ("P1", "stopped", "midair stop")


@pytest.mark.clock
@pytest.mark.slow
def test_units_that_get_too_hot_end_the_command_with_status_1_and_the_log_says_why(tmp_path, tap):
    line = [sys.executable, "-m", "midair", "live", "--sensor", "virtual:brush", "--device", f"autd3:{tap.address}"]
    line += ["--override-exposure", "a test", "--duration", "60s"]
    environment = {**os.environ, "MIDAIR_STATE": str(tmp_path / "state")}
    running = subprocess.Popen(line, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: len(tap.frames()) >= 2000 or running.poll() is not None)
    tap.hot, began = range(65536), time.monotonic()
    _, said = running.communicate(timeout=30)
    assert "units 0, 1, 2, 3 too hot after " in said
    assert running.returncode == 1
    end = json.loads((tmp_path / "state" / "played.jsonl").read_text(encoding="utf-8").splitlines()[-1])
    assert (end["event"], end["outcome"]) == ("end", "failed")
    assert end["reason"].startswith("TooHotError: array: expected units that are not too hot, got units 0, 1, 2, 3")
    last = max(at for at, _, command, datagram in tap.frames() if command == 0x16 and any(datagram[-249:]))
    assert last - began < 0.6
    assert not any(tap.frames()[-1][3][-249:])


@pytest.mark.slow
@pytest.mark.clock
def test_a_command_that_waits_for_hot_units_is_silent_and_ends_with_status_0(tmp_path, tap, request):
    line = [sys.executable, "-m", "midair", "live", "--sensor", "virtual:brush", "--device", f"autd3:{tap.address}"]
    line += ["--override-exposure", "a test", "--duration", "12s", "--when-hot", "wait"]
    environment = {**os.environ, "MIDAIR_STATE": str(tmp_path / "state"), "COLUMNS": "300"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    running = subprocess.Popen(line, cwd=tmp_path, env=environment, text=True, **pipes)
    request.addfinalizer(running.kill)
    wait_until(lambda: len(tap.frames()) >= 2000 or running.poll() is not None)
    tap.hot = range(65536)
    told = iter(running.stderr.readline, "")
    assert any("units 0, 1, 2, 3 too hot" in each for each in told)
    paused = time.monotonic()
    while time.monotonic() < paused + 1.5:
        time.sleep(0.05)
    assert not any(any(datagram[-249:]) for at, _, code, datagram in tap.frames() if code == 0x16 and at > paused + 0.1)
    tap.hot, cooled = (), time.monotonic()
    assert any("units have cooled; playback continues after a pause of" in each for each in told)
    printed, rest = running.communicate(timeout=60)
    assert running.returncode == 0, rest
    assert "frames dropped while a unit was too hot" in printed
    assert any(any(datagram[-249:]) for at, _, code, datagram in tap.frames() if code == 0x16 and at > cooled)
    entries = map(json.loads, (tmp_path / "state" / "played.jsonl").read_text(encoding="utf-8").splitlines())
    assert [each["event"] for each in entries] == ["play", "pause", "continue", "end"]


@pytest.mark.clock
@pytest.mark.slow
def test_a_session_continues_after_a_pause_of_the_computer(tap):
    with midair.live("virtual:towel", f"autd3:{tap.address}", exposure=ANSWERED) as session:
        session.wait(1.5)
        os.kill(session._process.pid, signal.SIGSTOP)
        time.sleep(0.2)
        os.kill(session._process.pid, signal.SIGCONT)
        session.wait(3.0)
        told = session.statistics
    assert told.failsafe >= 1
    assert told.played > 1000
    assert sum(told.over_time["gaps"]) == told.gaps >= 1


@pytest.mark.slow
def test_a_killed_process_is_reported():
    with pytest.raises(DeviceError, match="without a report"), midair.live("virtual:brush") as session:
        session.wait(0.5)
        os.kill(session._process.pid, signal.SIGKILL)
        session.wait(5.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stated", "status", "words"), [((), 0, ""), (("--duration", "60s"), 130, "midair: stopped; kept felt.h5\n")]
)
def test_the_command_prints_numbers_for_a_program_and_ends_by_ctrl_c(tmp_path, stated, status, words):
    line = [sys.executable, "-m", "midair", "live", "--json", "--keep", "felt.h5", *stated]
    running = subprocess.Popen(line, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_until((tmp_path / "felt.h5").exists)
    time.sleep(1.0)
    running.send_signal(signal.SIGINT)
    said, beside = running.communicate(timeout=30)
    told = json.loads(said)
    assert running.returncode == status
    assert beside.endswith(words)
    assert all(np.isfinite(told[name]) for name in ("frames", "lost", "late", "latency"))
    assert told["latency"] == pytest.approx(13.0, abs=0.1)
    assert open_take(tmp_path / "felt.h5").recording.frames == told["frames"] > 500


@contextmanager
def skin(rate):
    """The name of a stream of another program, which sends so many frames a second, and the program."""
    pytest.importorskip("pylsl")
    os.environ.setdefault("LSLAPICFG", str(Path(__file__).parents[2] / "devices" / "sensors" / "lsl_api.cfg"))
    name, here = f"midair-{os.getpid()}-{time.monotonic_ns()}", Path(__file__).parent
    command = [sys.executable, str(here / "touch_sender.py"), name, str(rate)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sender:
        try:
            assert sender.stdout.readline().strip() == "ready"
            yield f"lsl:{name}?search=60&counter=16&timeout=20", sender
        finally:
            sender.kill()


def check_rate_report(line, rate, status):
    done = subprocess.run([*line, "--json"], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == status, done.stderr
    told = json.loads(done.stdout)
    assert (told["stated_rate_hz"], told["rate_hz"]) == (1000.0, pytest.approx(rate, rel=0.01))
    assert done.stderr.count("expected 1000 frames per second, measured ") == 1
    return told


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "status"), [(900, 1), (970, 0)])
def test_a_sensor_with_another_rate_than_stated_is_reported(rate, status):
    with skin(rate) as (sensor, _):
        line = [sys.executable, "-m", "midair", "live", "--sensor", sensor, "--duration", "8s"]
        told = check_rate_report(line, rate, status)
    assert sum(told["over_time"]["late"]) == told["late"]


@pytest.mark.slow
def test_all_frames_of_another_program_arrive_and_lost_ones_are_counted(tmp_path):
    path = tmp_path / "felt.h5"
    live = {"exposure": ANSWERED, "duration": 5.0, "keep": path}
    with skin(1000) as (name, _), midair.live(name, "autd3:emulator", **live) as session:
        session.wait()
    told, felt, played = session.statistics, open_take(path).recording.samples[:, 1, 1], load_played(path)
    assert told.frames == len(felt) == played.frames
    assert told.lost == pytest.approx(100, abs=20)
    # In step with the tone from the first frame to the last but for the frames left out, whose place holds.
    sent = 20.0 * np.sin(0.2 * np.pi * (np.arange(len(felt)) + np.arange(10)[:, None]))
    held = (np.abs(felt - sent) > 1e-3).sum(axis=1).min()
    assert held <= told.lost
    assert ((played.state & 1) > 0).sum() > 1000


@pytest.mark.slow
def test_a_program_that_ends_is_a_sensor_that_is_lost():
    with (
        skin(1000) as (name, running),
        pytest.raises(DeviceError, match="lsl"),
        midair.live(name, "autd3:emulator", exposure=ANSWERED) as session,
    ):
        session.wait(1.0)
        running.kill()
        wait_until(lambda: not session.wait(0.1), 10)
