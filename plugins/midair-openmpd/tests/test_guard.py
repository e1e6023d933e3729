import os
import random
import signal
import subprocess
import sys
import time

import psutil
import pytest
from tests.waiting import wait_until

PLAYER = """
import sys
import numpy as np
from midair.errors import DeviceError
from midair.model import Drive
from midair_openmpd import Board, OpenMpdArray, array_of_boards
from tests.simulators.exposure_override import clear_any_exposure

board = Board.nominal()
array = array_of_boards(board)
drive = Drive(phase=np.zeros((1000, 256)), level=np.ones(1000), rate=1000.0, array=array)
device = OpenMpdArray([sys.argv[1]], [board])
try:
    with device:
        device.play(clear_any_exposure(drive, device, repeats=3600))
except DeviceError as wrong:
    print(wrong)
    sys.exit(1)
"""


@pytest.fixture
def player(board, tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    made = []

    def start():
        made.append(subprocess.Popen([sys.executable, "-c", PLAYER, board.port], stdout=subprocess.PIPE, text=True))
        wait_until(lambda: board.sounds)
        return made[-1]

    yield start
    for one in made:
        one.kill()
        one.communicate()


def assert_stays_silent(board):
    wait_until(lambda: not board.sounds)
    board.settle()
    count = len(board.heard)
    time.sleep(0.1)
    assert not board.sounds
    assert len(board.heard) == count


@pytest.mark.parametrize("kills", [pytest.param(2, marks=pytest.mark.long), pytest.param(30, marks=pytest.mark.slow)])
def test_a_program_that_is_killed_at_any_moment_leaves_silence(board, player, kills):
    rng = random.Random(7)
    for _ in range(kills):
        one = player()
        time.sleep(rng.uniform(0, 0.15))
        one.kill()
        one.wait()
        assert_stays_silent(board)


# In real time: on a busy machine a write runs into its own limit before the guard is heard.
@pytest.mark.slow
def test_a_stopped_program_leaves_silence_and_reports_it_afterwards(board, player):
    one = player()
    os.kill(one.pid, signal.SIGSTOP)
    assert_stays_silent(board)
    os.kill(one.pid, signal.SIGCONT)
    said, _ = one.communicate(timeout=60)
    assert one.returncode == 1
    assert "delayed by more than 1 s during playback, and its guard silenced the boards" in said
    assert_stays_silent(board)


@pytest.mark.long
def test_keys_at_the_terminal_do_not_reach_the_guard(board, player):
    """The guard has its own session: a signal to the whole process group must not end it."""
    one = player()
    (guard,) = psutil.Process(one.pid).children()
    assert os.getsid(guard.pid) != os.getsid(one.pid)


@pytest.mark.long
def test_a_program_whose_guard_was_ended_plays_no_further(board, player):
    one = player()
    (guard,) = psutil.Process(one.pid).children()
    guard.kill()
    said, _ = one.communicate(timeout=60)
    assert one.returncode == 1
    assert "the guard was terminated" in said
    assert_stays_silent(board)
