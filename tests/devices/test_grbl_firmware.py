"""The Grbl driver against Grbl's own firmware, built from the reader's checkouts in the makers' simulator.

``MIDAIR_GRBL=FOLDER`` names a folder with checkouts of gnea/grbl (``grbl``) and grbl/grbl-sim (``grbl-sim``); a C
compiler and make are needed. Limit switches, alarms and homing are not part of that simulator.
"""

import os
import pty
import select
import shutil
import signal
import subprocess
import sys
import time
import tty
from pathlib import Path

import pytest
from tests.waiting import wait_until

from midair.devices import GrblStage
from midair.errors import InputError, LinkLostError
from midair.model import speed_of

SOURCES = os.environ.get("MIDAIR_GRBL", "")
STEP = 1 / 250e3
"""One step of the firmware's default settings ($100 = 250 steps per mm), in m."""

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not SOURCES, reason="MIDAIR_GRBL names no checkouts of Grbl and its simulator"),
    pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler"),
]


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    """The simulator, built outside the checkouts: it expects to lie inside Grbl's source folder."""
    folder = tmp_path_factory.mktemp("grbl")
    shutil.copytree(Path(SOURCES) / "grbl" / "grbl", folder / "grbl")
    shutil.copytree(Path(SOURCES) / "grbl-sim", folder / "grbl" / "grbl-sim", ignore=shutil.ignore_patterns(".git"))
    # -fcommon: a header defines variables, which newer compilers refuse otherwise.
    built = folder / "grbl" / "grbl-sim"
    subprocess.run(["make", "main", "FLAGS=-O1 -w -fcommon"], cwd=built, check=True, capture_output=True, timeout=300)
    return built / "grbl_sim.exe"


class Machine:
    """The firmware in a process; its serial port is a pseudo-terminal."""

    def __init__(self, program, folder):
        self._driver, slave = pty.openpty()
        # Kept open, so that the firmware has a line before the driver opens it.
        tty.setraw(slave)
        self._slave, self.port = slave, os.ttyname(slave)
        self.process = subprocess.Popen(
            # -i0: the simulator polls the file, so no byte may wait in a buffer. -b, -s: no traces.
            ["stdbuf", "-i0", "-o0", program, "1", "-n", "-s", os.devnull, "-b", os.devnull],
            cwd=folder,
            stdin=self._driver,
            stdout=self._driver,
            stderr=subprocess.DEVNULL,
        )

    def set(self, **settings):
        """Write settings such as s110=6000 ($110=6000), one at a time: the firmware writes each to its memory."""
        self._read_until(b"help]")
        for name, value in settings.items():
            os.write(self._slave, f"${name[1:]}={value}\n".encode())
            self._read_until(b"ok")

    def _read_until(self, mark):
        received, end = b"", time.monotonic() + 20
        while mark not in received:
            assert time.monotonic() < end, received
            if select.select([self._slave], [], [], 0.1)[0]:
                received += os.read(self._slave, 1024)

    def close(self):
        self.process.kill()
        self.process.wait()
        os.close(self._driver)
        os.close(self._slave)


@pytest.fixture
def machine(firmware, tmp_path):
    made = Machine(firmware, tmp_path)
    # Inverted inputs: the simulator's open pins read as pressed switches. x: 50 mm/s and 500 mm/s2.
    made.set(s5=1, s6=1, s110=3000, s120=500)
    yield made
    made.close()


@pytest.fixture
def stage(machine):
    with GrblStage(machine.port, search=20.0) as opened:
        opened.ready(homing=False)
        yield opened


def go(stage, x, speed, stopped=lambda: False):
    stamps = []
    times = stage.move((x, 0.0, 0.0), speed, stamp=stamps.append, stopped=stopped)
    return times, stamps


def position(stage):
    return stage.ready(homing=False).position


def test_opening_moves_nothing_and_names_the_firmware(stage):
    assert stage.firmware.startswith("Grbl 1.1h")
    assert position(stage) == (0.0, 0.0, 0.0)


def test_strokes_end_to_a_step_and_their_stamps_give_the_speed(stage):
    for target in (-0.06, 0.02, -0.0335):
        times, stamps = go(stage, target, 0.04)
        assert stamps[-1].position[0] == pytest.approx(target, abs=STEP)
        moving = [stamp for stamp in stamps if times[0] <= stamp.time <= times[1] and stamp.feed > 0.0399]
        # The firmware's own feed, against the positions that it reports; its clock may run late on a busy machine.
        assert 0.7 * 0.04 < speed_of(moving) < 1.05 * 0.04
    assert position(stage)[0] == pytest.approx(-0.0335, abs=STEP)


def test_a_speed_above_its_largest_is_refused_before_it_moves(stage):
    with pytest.raises(InputError, match="up to 50 mm/s"):
        stage.check_speed(0.06, 0.1, 0)
    assert position(stage) == (0.0, 0.0, 0.0)


def test_a_stop_holds_it_and_it_never_moves_by_itself_again(stage):
    end = time.monotonic() + 1.0
    times, _ = go(stage, -0.2, 0.04, stopped=lambda: time.monotonic() > end)
    assert times is None
    stood = position(stage)
    assert -0.1 < stood[0] < 0
    time.sleep(1.0)
    assert position(stage) == stood
    go(stage, stood[0] + 0.002, 0.04)
    assert position(stage)[0] == pytest.approx(stood[0] + 0.002, abs=STEP)


def test_a_machine_that_no_longer_answers_is_given_up_within_seconds(stage, machine):
    calls = []

    def silent():
        calls.append(None)
        if len(calls) == 20:
            machine.process.send_signal(signal.SIGSTOP)
        return False

    begin = time.monotonic()
    with pytest.raises(LinkLostError, match=r"no answer for 2 s.*may not have reached"):
        go(stage, -0.2, 0.01, stopped=silent)
    assert time.monotonic() - begin < 15
    machine.process.send_signal(signal.SIGCONT)


STROKES = """
homing = "by hand"
heading = "+x"
start_mm = [-60.0, -4.0]
contact_mm = -5.0
clear_mm = -2.5
approach_mm_s = 5.0
return_mm_s = 8.0

[travel]
x_mm = [-190.0, 0.0]
y_mm = [-190.0, 0.0]
z_mm = [-190.0, 0.0]
"""
PROGRAM = "import sys; from midair.cli import run; sys.exit(run(sys.argv[1:]))"


@pytest.fixture
def stroke(machine, tmp_path):
    """A program that records a stroke of six seconds, two seconds after its first frames."""
    (tmp_path / "stage.toml").write_text(STROKES, encoding="utf-8")
    with GrblStage(machine.port, search=20.0) as stage:
        stage.ready(homing=False)
        stage.move((-0.06, -0.004, -0.0025), 8e-3, stamp=lambda _: None, stopped=lambda: False)
    strokes = ["--stage", f"grbl:{machine.port}", "--stroke", "50mm", "--speed", "8mm/s"]
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "record", "virtual:towel", "out.h5", *strokes],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        # The file appears with the first frames, and the way down takes half a second.
        wait_until(lambda: list(tmp_path.glob("*.h5*")) or process.poll() is not None)
        time.sleep(2.0)
        yield process
    finally:
        process.kill()
        process.communicate()


def assert_stands_on_the_way(machine):
    with GrblStage(machine.port, search=20.0) as again:
        stood = position(again)
        assert -0.06 <= stood[0] < -0.01
        time.sleep(1.0)
        assert position(again) == stood


def test_ctrl_c_in_a_recorded_stroke_holds_the_machine(machine, stroke):
    stroke.send_signal(signal.SIGINT)
    printed = stroke.communicate(timeout=60)[1]
    assert stroke.returncode == 130, printed
    assert "the stage stands at x -" in printed
    assert_stands_on_the_way(machine)
