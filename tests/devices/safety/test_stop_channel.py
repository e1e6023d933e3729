import json
import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from midair.devices import make_state_folder, playing_now, state_folder, stop_playing
from midair.devices.safety import stop_channel
from midair.devices.safety.stop_channel import open_stop_channel, ordered_at, process_start_time, uptime
from midair.errors import DeviceError, FileError, StoppedError

HOLDER = """
import fcntl, os, sys, time
handle = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
fcntl.flock(handle, fcntl.LOCK_EX)
os.write(handle, sys.argv[2].encode())
print("held", flush=True)
time.sleep(60)
"""


@pytest.fixture(autouse=True)
def _no_units(monkeypatch):
    """There is no failsafe to wait for."""
    monkeypatch.setattr(stop_channel, "FAILSAFE", 0.0)


def test_another_terminal_silences_what_plays(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/usr/bin/midair", "play", "x.drive.h5"])
    silenced = []
    with open_stop_channel("a device", lambda: silenced.append(True)) as path:
        assert path.stat().st_mode & 0o077 == 0
        (stopped,) = stop_playing()
        (playing,) = playing_now()
    assert silenced == [True]
    assert (stopped.device, stopped.outcome, stopped.process) == ("a device", "silent", os.getpid())
    assert stopped.command == "midair play x.drive.h5"
    assert playing["device"] == "a device"
    assert stop_playing() == playing_now() == []


def test_a_stop_without_the_secret_has_no_effect():
    silenced = []
    with open_stop_channel("a device", lambda: silenced.append(True)) as path:
        entry = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(json.dumps({**entry, "secret": "guess"}), encoding="utf-8")
        (stopped,) = stop_playing(timeout=0.3)
    assert silenced == []
    assert stopped.outcome == "no answer"


def test_a_player_that_died_is_reported_once():
    folder = make_state_folder()
    (folder / "playing-1.json").write_text('{"process": 1, "device": "d", "port": 9, "secret": "s"}', encoding="utf-8")
    (folder / "playing-2.json").write_text("{", encoding="utf-8")
    assert playing_now() == []
    (folder / "playing-1.json").write_text('{"process": 1, "device": "d", "port": 9, "secret": "s"}', encoding="utf-8")
    assert [one.outcome for one in stop_playing()] == ["gone"]
    assert stop_playing() == []


MALFORMED = {
    "empty": b"",
    "no JSON": b"{",
    "no UTF-8": b"\xff\xfe{}",
    "a list": b'["process", "device", "port", "secret"]',
    "a number": b"7",
    "null": b"null",
    "deep": b"[" * 100_000,
    "a port that is none": b'{"process": 1, "device": "d", "port": 99999, "secret": "s"}',
    "a port that is text": b'{"process": 1, "device": "d", "port": "x", "secret": "s"}',
    "a process that is a list": b'{"process": [], "device": {}, "port": 1, "secret": []}',
    "long": b'{"process": 1, "device": "' + b"d" * 200_000,
}


def test_a_malformed_file_does_not_block_other_stops():
    for kind, content in MALFORMED.items():
        silenced, folder = [], make_state_folder()
        for name in ("playing-0.json", "playing-z.json"):
            (folder / name).write_bytes(content)
        with open_stop_channel("a device", lambda silenced=silenced: silenced.append(True)):
            outcomes = [one.outcome for one in stop_playing(timeout=5)]
        assert silenced == [True], kind
        assert sorted(outcomes) == ["gone", "gone", "silent"], kind


def test_an_entry_that_is_no_file_is_ignored():
    folder = make_state_folder()
    (folder / "playing-folder.json").mkdir()
    os.mkfifo(folder / "playing-pipe.json")
    (folder / "playing-link.json").symlink_to(folder / "nothing")
    with open_stop_channel("a device", lambda: None):
        outcomes = [one.outcome for one in stop_playing(timeout=5)]
    assert outcomes == ["silent"]


@pytest.mark.parametrize("content", ["{", '{"process": 7, "device": "d"}', "[]"])
def test_a_program_that_cannot_be_reached_is_reported_and_delays_no_other(content):
    silenced, path = [], make_state_folder() / "playing-0.json"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path), content], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"held\n"
        with open_stop_channel("a device", lambda: silenced.append(True)):
            outcomes = {one.device: one.outcome for one in stop_playing(timeout=0.5)}
        process.kill()
        process.communicate()
    assert sorted(outcomes.values()) == ["no answer", "silent"]
    assert silenced == [True]


@pytest.mark.long
def test_a_program_that_hangs_is_reported_and_the_others_are_silent_at_once():
    """The listening program is stopped by SIGSTOP, so that its port accepts the call but there is no answer."""
    player = (
        "import time\nfrom midair.devices.safety.stop_channel import open_stop_channel\n"
        "with open_stop_channel('hanging', lambda: None):\n    print('plays', flush=True)\n    time.sleep(60)"
    )
    silenced = []
    with subprocess.Popen([sys.executable, "-c", player], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"plays\n"
        process.send_signal(signal.SIGSTOP)
        with open_stop_channel("a device", lambda: silenced.append(True)):
            found = {one.device: one for one in stop_playing(timeout=0.5)}
        process.kill()
        process.communicate()
    assert found["a device"].outcome == "silent"
    assert (found["hanging"].outcome, found["hanging"].process) == ("no answer", process.pid)
    assert found["hanging"].reason
    assert silenced == [True]


def test_silence_is_reported_only_if_the_array_is_silent():
    def fail():
        raise DeviceError("autd3: no answer within 2 s")

    with open_stop_channel("a device", fail):
        (stopped,) = stop_playing()
    assert stopped.outcome == "no answer"
    assert "no answer within 2 s" in stopped.reason


def test_the_answer_waits_for_the_silence():
    order = []

    def slow():
        time.sleep(0.3)
        order.append("silence")

    with open_stop_channel("a device", slow, afterwards=lambda: order.append("afterwards")):
        (stopped,) = stop_playing()
        order.append(stopped.outcome)
    assert order.index("silence") < order.index("silent")
    assert order.index("silence") < order.index("afterwards")


def test_the_line_ends_with_the_block_also_when_it_fails():
    def fail():
        with open_stop_channel("a device", lambda: None) as path:
            assert json.loads(path.read_text(encoding="utf-8"))["process"] == os.getpid()
            raise ValueError("the array went away")

    with pytest.raises(ValueError, match="went away"):
        fail()
    assert not list(make_state_folder().glob("playing-*"))


def test_noise_on_the_port_is_not_an_order_and_other_computers_do_not_reach_it():
    silenced = []
    with open_stop_channel("a device", lambda: silenced.append(True)) as path:
        port = json.loads(path.read_text(encoding="utf-8"))["port"]
        for noise in (b"", b"\xff\xfe\n", b"silence\n", b"end\n", b"silence " + b"0" * 32 + b" more\n"):
            with socket.create_connection(("127.0.0.1", port), 1) as call:
                call.sendall(noise)
        # A connection without a message does not block other callers.
        with socket.create_connection(("127.0.0.1", port), 1):
            assert silenced == []
            (stopped,) = stop_playing()
    assert stopped.outcome == "silent"
    with open_stop_channel("a device", lambda: None) as path:
        port = json.loads(path.read_text(encoding="utf-8"))["port"]
        # A port bound to every address would refuse to be bound on another one of this computer.
        with socket.socket() as other:
            other.bind(("127.0.0.2", port))


def test_two_arrays_of_one_program_are_both_silenced():
    silenced = []
    with open_stop_channel("one", lambda: silenced.append(1)), open_stop_channel("two", lambda: silenced.append(2)):
        assert {one.device for one in stop_playing()} == {"one", "two"}
    assert sorted(silenced) == [1, 2]


def test_a_stop_before_the_line_is_open_counts_and_one_in_the_future_is_ignored():
    ordered = uptime()
    assert stop_playing() == []
    with (
        ordered_at(ordered),
        pytest.raises(StoppedError, match="during the start"),
        open_stop_channel("x", lambda: None),
    ):
        pass
    with open_stop_channel("a device", lambda: None):
        assert playing_now()
    # The computer was restarted, and its clock with it.
    make_state_folder()
    (state_folder() / "stopped-at").write_text(repr(uptime() + 1e6), encoding="ascii")
    with ordered_at(0.0), open_stop_channel("a device", lambda: None):
        assert playing_now()


@pytest.mark.long
def test_start_time_of_a_process():
    code = "from midair.devices.safety.stop_channel import process_start_time; print(process_start_time())"
    before = uptime()
    said = float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout)
    # Clock ticks of 10 ms are rounded down.
    assert before - 0.02 <= said <= uptime()
    assert process_start_time() < before


def test_a_stop_that_cannot_be_noted_still_silences(monkeypatch):
    silenced = []
    with open_stop_channel("a device", lambda: silenced.append(True)):
        (state_folder() / "stopped-at").mkdir()
        (stopped,) = stop_playing()
    assert stopped.outcome == "silent"
    with pytest.raises(FileError, match="may not stop"):
        stop_playing()


def test_a_line_that_cannot_be_opened_is_one_error(tmp_path, monkeypatch):
    (tmp_path / "state").mkdir()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    monkeypatch.setattr(stop_channel, "token", lambda: "fixed")
    (tmp_path / "state" / f"playing-{os.getpid()}-fixed.json").mkdir()
    with pytest.raises(FileError, match="set MIDAIR_STATE"), open_stop_channel("a device", lambda: None):
        pass
