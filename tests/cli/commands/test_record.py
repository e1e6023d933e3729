import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from tests.waiting import wait_until

from midair.cli import run
from midair.files import load, save
from midair.model import Recording

PROGRAM = "import sys; from midair.cli import run; sys.exit(run(sys.argv[1:]))"
SOURCE = Recording(samples=np.random.default_rng(0).normal(size=(600, 4, 4)), rate=1000.0)


@pytest.fixture(autouse=True)
def _source():
    save(SOURCE, "source.h5")


class Terminal:
    """A program on a pseudo-terminal: what it wrote, and keys for it."""

    def __init__(self, *arguments):
        self.main, self.side = pty.openpty()
        self.before = termios.tcgetattr(self.side)
        self.seen = ""
        environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "90", "LINES": "30"}
        self.pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-c", PROGRAM, *arguments],
            environment,
            file_actions=[
                (os.POSIX_SPAWN_OPEN, 0, os.ttyname(self.side), os.O_RDWR, 0),  # so that Ctrl-C is a signal
                (os.POSIX_SPAWN_DUP2, 0, 1),
                (os.POSIX_SPAWN_DUP2, 0, 2),
            ],
            setsid=True,
        )

    def until(self, words, *, seconds=60):
        end = time.monotonic() + seconds
        while not re.search(words, self.seen):
            assert time.monotonic() < end, f"{words!r} was not seen in {self.seen[-2000:]!r}"
            self._read(0.05)

    def press(self, keys):
        os.write(self.main, keys.encode())

    def end(self):
        """The exit status; the terminal must be as it was."""
        status = None
        while status is None:
            self._read(0.05)
            done, code = os.waitpid(self.pid, os.WNOHANG)
            status = os.waitstatus_to_exitcode(code) if done else None
        self._read(0.05)
        after = termios.tcgetattr(self.side)
        os.close(self.main)
        os.close(self.side)
        assert after == self.before
        return status

    def _read(self, wait):
        while select.select([self.main], [], [], wait)[0]:
            self.seen += os.read(self.main, 65536).decode("utf-8", "replace")
            wait = 0


@pytest.mark.long
def test_keys_start_and_stop_takes_and_meters_move():
    terminal = Terminal("record", "replay:source.h5", "--repeats", "3", "--object", "towel", "--pre-roll", "0s")
    terminal.until(r"○ waiting .*towel-01\.h5, take 1 of 3")
    terminal.press(" ")
    terminal.until(r"take 2 of 3")
    assert load("towel-01.h5").frames == 600
    terminal.press("\n")
    terminal.until(r"take 3 of 3")
    terminal.press("q")
    assert terminal.end() == 0
    assert sorted(path.name for path in Path().glob("towel*")) == ["towel-01.h5", "towel-02.h5"]
    assert load("towel-02.h5").provenance.notes == {"object": "towel"}
    assert load("towel-02.h5").provenance.steps[0].settings == {
        "take": 2,
        "takes": 3,
        "start": "key",
        "pre_roll_s": 0.0,
    }
    for channel in range(16):
        assert re.search(rf"{channel:2d} .{{0,12}}[█|·]", terminal.seen), "every channel has a meter"


@pytest.mark.long
def test_ctrl_c_on_a_terminal_keeps_recorded_frames():
    save(Recording(samples=np.tile(SOURCE.samples, (50, 1, 1)), rate=1000.0), "long.h5")
    stated = ("--object", "towel", "--surface", "flat", "--speed", "50mm/s", "--operator", "me")
    terminal = Terminal("record", "replay:long.h5", "take.h5", "--real-time", "--trigger", "2V", *stated)
    terminal.until(r"touched[\s\S]*● REC")
    terminal.press("\x03")
    assert terminal.end() == 130
    assert "stopped; " in terminal.seen
    assert load("take.h5").frames > 0
    assert "Traceback" not in terminal.seen


def test_ctrl_c_between_takes_prints_the_number_kept(capsys):
    def stop():
        while not Path("takes-01.h5").exists():
            time.sleep(0.01)
        # The file has its name a moment before the pause begins.
        time.sleep(0.3)
        os.kill(os.getpid(), signal.SIGINT)

    (stopper := threading.Thread(target=stop)).start()
    said = ["--duration", "0.05s", "--real-time", "--repeats", "3", "--pause", "30s"]
    assert run(["record", "virtual:towel", "takes.h5", *said]) == 130
    stopper.join()
    assert capsys.readouterr().err.endswith("midair: stopped; kept 1 of 3 takes\n")
    assert [path.name for path in Path().glob("takes*")] == ["takes-01.h5"]


@pytest.mark.long
def test_a_virtual_hour_streams_and_sigterm_ends_it_at_once(capsys):
    def stop():
        wait_until(lambda: any(Path().glob("*hour*")))
        ended.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGTERM)

    ended = []
    (stopper := threading.Thread(target=stop)).start()
    assert run(["record", "virtual:towel", "hour.h5", "--duration", "1h"]) == 130
    assert time.monotonic() - ended[0] < 10
    stopper.join()
    kept = load("hour.h5").frames
    assert 0 < kept < 600_000
    assert capsys.readouterr().err.endswith(f"midair: stopped; {kept} frames are in hour.h5\n")


@pytest.mark.slow
def test_a_terminal_is_restored_on_sigterm():
    terminal = Terminal("record", "replay:source.h5", "--repeats", "2")
    terminal.until("waiting")
    os.kill(terminal.pid, signal.SIGTERM)
    assert terminal.end() == 130
    assert "this take has no frames" in terminal.seen


@pytest.mark.long
def test_missing_notes_are_asked_once_and_offered_again(capsys):
    answers = {"object": "Towel", "surface": "", "speed": "50mm/s", "operator": "me"}
    terminal = Terminal("record", "replay:source.h5", "--real-time", "--surface", "flat")
    for name in ("object", "speed", "operator"):
        terminal.until(f"{name}: ")
        terminal.press(f"{answers[name]}\n")
    assert terminal.end() == 0
    assert load("towel-flat-01.h5").provenance.notes == answers | {"object": "Towel", "surface": "flat"}
    terminal = Terminal("record", "replay:source.h5", "--real-time")
    for name, offered in (("object", "Towel"), ("surface", "flat"), ("speed", "50mm/s"), ("operator", "me")):
        terminal.until(rf"{name} \[{offered}\]: ")
        terminal.press("\n" if name != "surface" else "rough\n")
    assert terminal.end() == 0
    assert load("towel-rough-01.h5").provenance.notes == answers | {"object": "Towel", "surface": "rough"}


@pytest.mark.long
def test_names_make_themselves_and_the_virtual_object_is_known(answer):
    takes = answer("record", "virtual:towel+groove", "--duration", "0.1s", "--repeats", "2", "--pause", "50ms")
    assert [take["recording"] for take in takes] == ["towel-groove-01.h5", "towel-groove-02.h5"]
    assert [take["frames"] for take in takes] == [100, 100]
    assert load("towel-groove-02.h5").provenance.notes == {"object": "towel", "surface": "groove"}
    assert load("towel-groove-02.h5").provenance.simulated


@pytest.mark.slow
def test_a_real_stream_with_holes_is_recorded_over_its_transport(monkeypatch, answer):
    """LSL over loopback; the sender leaves out seven frames now and then, which its counter shows."""
    pytest.importorskip("pylsl")
    here = Path(__file__).parents[2] / "devices" / "sensors"
    monkeypatch.setenv("LSLAPICFG", str(here / "lsl_api.cfg"))
    name = f"record {os.getpid()}"
    command = [sys.executable, here / "lsl_sender.py", name, "-", "7", "0", "0", "cast"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as sender:
        try:
            assert sender.stdout.readline().strip() == "ready"
            source = f"lsl:{name}?search=60&counter=16&timeout=20"
            (take,) = answer("record", source, "take.h5", "--duration", "8s")
        finally:
            sender.kill()
    recording = load("take.h5")
    assert recording.frames == take["frames"] == 8000
    frames = np.rint(recording.samples.reshape(8000, 16)).astype(int)
    np.testing.assert_array_equal(frames - frames[:, :1], np.broadcast_to(np.arange(16), (8000, 16)))
    lost = np.zeros(8000, bool)
    for first, count in recording.provenance.steps[-1].settings["lost"]:
        lost[first : first + count] = True
    assert lost.sum() == take["lost_frames"] > 0
    number = frames[:, 0] // 16
    expected = (number[0] + np.arange(8000)) % 2048
    np.testing.assert_array_equal(number[~lost], expected[~lost], "frame i stays at i / rate")
    assert abs(take["rate_ppm"]) < 5000
