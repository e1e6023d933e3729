import getpass
import os
import signal
import subprocess
import sys
import tempfile

import pytest

from midair.devices import device_lock, make_state_folder, state_folder
from midair.errors import FileError, HeldError

HOLDER = """
import fcntl, os, sys, time  # The other user may not read the folders of this Python.
from midair.devices import device_lock
if len(sys.argv) > 2:
    os.environ["MIDAIR_STATE"] = sys.argv[2]
if len(sys.argv) > 3:
    os.setgroups([])
    os.setgid(int(sys.argv[3]))
    os.setuid(int(sys.argv[3]))
with device_lock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""
NOBODY = 65534
AUTD3 = f"autd3-{os.getpid()}"
"""A device of this run alone: on Linux a lock holds for the whole computer."""


def holding(*words):
    process = subprocess.Popen([sys.executable, "-c", HOLDER, *map(str, words)], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"held\n"
    return process


@pytest.mark.long
@pytest.mark.parametrize(
    ("held", "asked"),
    [
        (f"{AUTD3}:eth0", f"{AUTD3}:eth0"),
        (AUTD3, f"{AUTD3}:eth0"),
        (f"{AUTD3}:eth0", AUTD3),
        (f"serial:/dev/{AUTD3}", f"serial:/dev/{AUTD3}"),
    ],
    ids=["one interface", "all and one", "one and all", "a port"],
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


@pytest.mark.parametrize(
    ("held", "asked"),
    [(f"{AUTD3}:eth0", f"{AUTD3}:eth1"), (AUTD3, f"{AUTD3}0"), (f"{AUTD3}/b", AUTD3)],
    ids=["another interface", "a longer name", "another path"],
)
def test_other_devices_are_free(held, asked):
    with device_lock(held), device_lock(asked):
        pass


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_lock_goes_with_its_process(number):
    with holding(AUTD3) as process:
        process.send_signal(number)
        process.wait()
    with device_lock(AUTD3):
        pass
    assert list(state_folder().glob("device-*")) == []


@pytest.fixture
def elsewhere():
    # Other users cannot enter pytest's folders.
    with tempfile.TemporaryDirectory() as folder:
        yield folder


linux = pytest.mark.skipif(sys.platform != "linux", reason="a lock for all users needs Linux")


@pytest.mark.long
@linux
@pytest.mark.parametrize(("held", "asked"), [("", ""), ("", ":eth0"), (":eth0", ""), (100 * "a", 100 * "a")])
def test_a_program_with_another_state_folder_is_refused_and_the_first_one_named(held, asked, elsewhere):
    """Before, the second program took the units from the first."""
    with holding(AUTD3 + held, elsewhere) as process:
        with pytest.raises(HeldError) as refused, device_lock(AUTD3 + asked):
            pass
        process.kill()
        process.wait()
        with device_lock(AUTD3 + asked):
            pass
    line = str(refused.value)
    assert "\n" not in line
    assert f"process {process.pid} of user {getpass.getuser()} ({sys.executable} -c" in line


@pytest.mark.long
@linux
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can become another user")
def test_two_users_do_not_get_one_device(elsewhere):
    os.chown(elsewhere, NOBODY, NOBODY)
    with holding(AUTD3, elsewhere, NOBODY) as process:
        with pytest.raises(HeldError, match=f"process {process.pid} of user nobody "), device_lock(AUTD3):
            pass
        process.kill()
    # The other way round: their program is refused, and this user's state is closed to it.
    with device_lock(AUTD3):
        mine = f"process {os.getpid()} of user {getpass.getuser()} "
        for folder, refusal in ((elsewhere, mine), (state_folder(), "set MIDAIR_STATE to a folder you can write to")):
            words = [sys.executable, "-c", HOLDER, AUTD3, str(folder), str(NOBODY)]
            done = subprocess.run(words, capture_output=True, text=True)
            assert refusal in done.stderr.splitlines()[-1]


def test_a_stale_file_is_no_harm():
    folder = make_state_folder()
    for name, content in ((f"device-{AUTD3}.json", "{"), (f"device-{AUTD3}%3Aeth0.json", '{"process": 1}')):
        (folder / name).write_text(content, encoding="utf-8")
    with device_lock(AUTD3):
        pass
    assert list(folder.glob("device-*")) == []


def test_one_program_may_not_have_it_twice_either():
    with device_lock(AUTD3):
        with pytest.raises(HeldError, match=f"process {os.getpid()} "), device_lock(AUTD3):
            pass
        with pytest.raises(HeldError), device_lock(AUTD3):
            pass
    with device_lock(AUTD3):
        pass


def test_a_symbolic_link_is_not_followed_and_a_folder_in_its_place_one_error(tmp_path):
    mine = tmp_path / "mine"
    mine.write_text("precious", encoding="utf-8")
    (make_state_folder() / f"device-{AUTD3}.json").symlink_to(mine)
    with pytest.raises(FileError, match="expected a file, got a symbolic link; remove it"), device_lock(AUTD3):
        pass
    assert mine.read_text(encoding="utf-8") == "precious"
    (make_state_folder() / f"device-{AUTD3}.json").unlink()
    (make_state_folder() / f"device-{AUTD3}.json").mkdir()
    with pytest.raises(FileError, match="set MIDAIR_STATE"), device_lock(AUTD3):
        pass
