"""One program per device, and no lock left after a process died."""

import os
import signal
import subprocess
import sys

import pytest

from midair.devices import device_lock, make_state_folder, state_folder
from midair.errors import FileError, HeldError

HOLDER = """
import sys, time
from midair.devices import device_lock
with device_lock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


def holding(device):
    process = subprocess.Popen([sys.executable, "-c", HOLDER, device], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"held\n"
    return process


@pytest.mark.parametrize(
    ("held", "asked"),
    [
        ("autd3:eth0", "autd3:eth0"),
        ("autd3", "autd3:eth0"),
        ("autd3:eth0", "autd3"),
        ("serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0"),
    ],
)
def test_the_second_program_is_refused_and_the_first_one_named(held, asked):
    with holding(held) as process:
        with pytest.raises(HeldError) as refused, device_lock(asked):
            pass
        process.kill()
    line = str(refused.value)
    assert "\n" not in line
    assert line.startswith(f"{asked}: ")
    assert f"process {process.pid} (-c {held}) has had it since 20" in line


@pytest.mark.parametrize(("held", "asked"), [("autd3:eth0", "autd3:eth1"), ("autd3", "autd30"), ("a/b", "a")])
def test_other_devices_are_free(held, asked):
    with device_lock(held), device_lock(asked):
        pass


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_lock_goes_with_its_process(number):
    with holding("autd3") as process:
        process.send_signal(number)
        process.wait()
    with device_lock("autd3"):
        pass
    assert list(state_folder().glob("device-*")) == []


def test_a_stale_file_is_no_harm():
    folder = make_state_folder()
    for name, content in (("device-autd3.json", "{"), ("device-autd3%3Aeth0.json", '{"process": 1}')):
        (folder / name).write_text(content, encoding="utf-8")
    with device_lock("autd3"):
        pass
    assert list(folder.glob("device-*")) == []


def test_one_program_may_not_have_it_twice_either():
    with device_lock("autd3"):
        with pytest.raises(HeldError, match=f"process {os.getpid()} "), device_lock("autd3"):
            pass
        with pytest.raises(HeldError), device_lock("autd3"):
            pass
    with device_lock("autd3"):
        pass


def test_a_symbolic_link_is_not_followed(tmp_path):
    mine = tmp_path / "mine"
    mine.write_text("precious", encoding="utf-8")
    (make_state_folder() / "device-autd3.json").symlink_to(mine)
    with pytest.raises(FileError, match="expected a file, got a symbolic link; remove it"), device_lock("autd3"):
        pass
    assert mine.read_text(encoding="utf-8") == "precious"


def test_a_file_that_cannot_be_is_one_error():
    (make_state_folder() / "device-autd3.json").mkdir()
    with pytest.raises(FileError, match="set MIDAIR_STATE"), device_lock("autd3"):
        pass
