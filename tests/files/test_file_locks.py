import fcntl
import os
import platform
import subprocess
import sys

import numpy as np
import pytest

from midair.errors import DeviceStateError, FileError
from midair.files import atomic, check_not_recording, lock_or_raise, save
from midair.files.atomic import atomic_file
from midair.model import Recording

HOLDER = """
import os, sys
from pathlib import Path
from midair.files.atomic import acquire_for_writing, lock_or_raise
file = os.open(sys.argv[2], os.O_RDWR)
lock_or_raise(file, "held") if sys.argv[1] == "hold" else acquire_for_writing(file, Path(sys.argv[2]))
print("has it", flush=True)
sys.stdin.read()
"""


def holder(how, path):
    """Another program that has locked a file and has reported it."""
    words = [sys.executable, "-c", HOLDER, how, str(path)]
    program = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert program.stdout is not None
    assert program.stdout.readline() == "has it\n"
    return program


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "log"
    path.write_text("precious")
    return path


@pytest.mark.long
def test_one_program_at_a_time_until_it_ends_however_it_ends(path):
    mine = os.open(path, os.O_RDWR)
    with holder("hold", path) as other:
        with pytest.raises(DeviceStateError, match="end the other one first"):
            lock_or_raise(mine, "log: end the other one first")
        other.kill()
    lock_or_raise(mine, "log: end the other one first")
    os.close(mine)


def test_a_failing_lock_blames_no_program(path):
    mine = os.open(path, os.O_RDWR)
    os.close(mine)
    with pytest.raises(FileError, match="log: cannot be locked: Bad file"):
        lock_or_raise(mine, "log: end the other one first")


@pytest.mark.parametrize("way", ["places", pytest.param("whole files", marks=pytest.mark.long)])
def test_files_of_other_writers_are_not_replaced_but_readable(way, path, monkeypatch):
    if way == "whole files":  # as on systems without locks that belong to an open file
        monkeypatch.setattr(atomic, "fcntl", without_places())
        monkeypatch.setitem(globals(), "HOLDER", HOLDER.replace("file = os", f"{WITHOUT_PLACES}; file = os"))
    elif not hasattr(fcntl, "F_OFD_SETLK"):
        pytest.skip("this system has no locks that belong to an open file")
    with holder("claim", path) as other:
        for _ in range(2):
            with pytest.raises(FileError, match="is recording into it; wait until") as caught, atomic_file(path):
                pass
        if way == "places" and sys.platform == "linux":
            assert f"process {other.pid} ({sys.executable} -c" in str(caught.value)
        assert "\n" not in str(caught.value)
        assert path.read_text() == "precious"
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # what HDF5 does to read
        other.kill()
    check_not_recording(path)
    assert [each.name for each in path.parent.iterdir()] == ["log"]


WITHOUT_PLACES = "import fcntl; vars(fcntl).pop('F_OFD_SETLK', 0); vars(fcntl).pop('F_OFD_GETLK', 0)"


def without_places():
    names = {name: value for name, value in vars(fcntl).items() if not name.startswith("F_OFD")}
    return type("fcntl", (), {**names, "flock": staticmethod(fcntl.flock)})


def test_a_claim_of_its_own_is_refused_too(path):
    with path.open("rb+") as file:
        atomic.acquire_for_writing(file.fileno(), path)
        with pytest.raises(FileError, match="this program is recording into it"):
            check_not_recording(path)
    check_not_recording(path)


def test_missing_files_and_folders_are_not_locked(tmp_path):
    check_not_recording(tmp_path)
    check_not_recording(tmp_path / "nothing")


WITHOUT_LOCKS = """
import ctypes, struct, sys, errno
def step(code, yes, no, value): return struct.pack("HBBI", code, yes, no, value)
# Linux itself answers ENOLCK to flock and to the locks of fcntl (36 to 38), as on a network disk without a lock daemon.
program = b"".join([step(0x20, 0, 0, 0), step(0x15, 5, 0, 73), step(0x15, 0, 3, 72), step(0x20, 0, 0, 24),
                    step(0x35, 0, 1, 36), step(0x35, 0, 1, 39), step(0x06, 0, 0, 0x7FFF0000),
                    step(0x06, 0, 0, 0x00050000 | errno.ENOLCK)])
class Program(ctypes.Structure):
    _fields_ = [("length", ctypes.c_ushort), ("steps", ctypes.c_char_p)]
libc = ctypes.CDLL(None, use_errno=True)
assert libc.prctl(38, 1, 0, 0, 0) == 0
if libc.prctl(22, 2, ctypes.byref(Program(8, program)), 0, 0):
    sys.exit(77)
from midair.cli import main
main(sys.argv[1:])
"""


@pytest.mark.long
@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="refuses system calls of 64-bit Linux by number"
)
def test_a_disk_without_locks_is_reported_once_and_not_refused(tmp_path):
    def run(*words):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT_LOCKS, *words], capture_output=True, text=True, check=False, cwd=tmp_path
        )
        if done.returncode == 77:
            pytest.skip("the system does not let a program refuse itself system calls")
        return done

    samples = np.random.default_rng(0).standard_normal((200, 4, 4))
    save(Recording(samples=samples, rate=1000.0), tmp_path / "source.h5")
    done = run("record", "replay:source.h5", "n.h5", "--quiet")
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stderr.splitlines() if "lock" in line]
    assert told == [
        "midair: this disk has no locks (No locks available): make sure that no two programs write to the same file"
    ]
    done = run("calibrate", "n.h5", "--sensitivity", "1V/Pa")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("no locks") == 1
    assert "another program" not in done.stderr
    assert "damaged" not in done.stderr
    done = run("study", "new", "s", "--drives", "none")
    assert done.returncode == 0, done.stderr
    done = run("study", "run", "s", "--simulate", "--participant", "1")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("no locks") == 1
