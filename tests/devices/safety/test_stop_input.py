import os
import subprocess
import sys
import threading
import time

import pytest

from midair.devices.safety.stop_channel import open_stop_channel
from midair.devices.safety.stop_guard import open_stop_input, stop_on_input
from midair.errors import DeviceError, InputError, StoppedError


@pytest.fixture
def line():
    master, slave = os.openpty()
    yield master, f"serial:{os.ttyname(slave)}", slave
    for handle in (master, slave):
        try:
            os.close(handle)
        except OSError:
            continue


def silenced_after(action, name):
    """Time from an action to the silence of something that plays, in s."""
    silent = threading.Event()
    with stop_on_input(name), open_stop_channel("a device", silent.set):
        assert not silent.wait(0.1)
        began = time.monotonic()
        action()
        assert silent.wait(5)
        return time.monotonic() - began


def test_any_byte_and_a_hang_up_silence(line):
    master, name, slave = line
    assert silenced_after(lambda: os.write(master, b"\0"), name) < 2
    os.close(slave)
    assert silenced_after(lambda: os.close(master), name) < 2


def test_an_input_without_a_terminal_silences_by_a_byte_and_by_its_end(tmp_path):
    """A named pipe in place of a foot switch, which is unplugged."""
    path = tmp_path / "event"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    writer = os.open(path, os.O_WRONLY)
    os.close(reader)
    assert silenced_after(lambda: os.write(writer, b"pressed"), f"evdev:{path}") < 2
    assert silenced_after(lambda: os.close(writer), f"evdev:{path}") < 2


def test_what_starts_after_the_loss_is_silenced_too(line):
    master, name, slave = line
    os.close(slave)
    silent = threading.Event()
    with stop_on_input(name):
        os.close(master)
        try:
            with open_stop_channel("a device", silent.set):
                assert silent.wait(5)
        except StoppedError:
            silent.set()
    assert silent.is_set()


KEYBOARD = """
import os, sys, threading
os.close(os.open(sys.argv[1], os.O_RDWR))
from midair.devices.safety.stop_channel import open_stop_channel
from midair.devices.safety.stop_guard import stop_on_input
silent = threading.Event()
with stop_on_input("keyboard"), open_stop_channel("a device", silent.set):
    print("plays", flush=True)
    sys.exit(0 if silent.wait(20) else 7)
"""


@pytest.mark.long
def test_a_key_of_the_terminal_silences_without_return():
    """A session leader that opens a terminal gets it as its own, as after a login."""
    master, slave = os.openpty()
    command = [sys.executable, "-c", KEYBOARD, os.ttyname(slave)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True) as player:
        assert player.stdout.readline() == b"plays\n"
        os.write(master, b"x")
        assert player.wait(30) == 0
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize("name", ["serial:", "gpio:7", ""])
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="expected serial:PORT, keyboard or evdev:PATH"), open_stop_input(name):
        pass


def test_without_its_input_nothing_plays(tmp_path):
    with pytest.raises(DeviceError, match="nothing plays without it"), stop_on_input(f"serial:{tmp_path}/none"):
        raise AssertionError("played without the input")
