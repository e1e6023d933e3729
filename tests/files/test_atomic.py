import errno
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError, DeviceStateError, FileError, NonFiniteError
from midair.files import check_not_recording, lock_or_raise, open_take, save
from midair.files.atomic import atomic_file, atomic_folder, collect_written_files, existing_file, parse_errors
from midair.model import Recording


def test_a_file_appears_when_the_block_ends_with_the_rights_of_any_new_one_or_behind_a_link(tmp_path):
    with atomic_file(tmp_path / "a.txt") as partial:
        partial.write_text("new")
        assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "a.txt").read_text() == "new"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]
    (tmp_path / "other").touch()
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "other").stat().st_mode
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    with atomic_file(tmp_path / "link.txt") as partial:
        partial.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


@pytest.mark.parametrize("wrong", [ValueError, KeyboardInterrupt, OSError, NonFiniteError])
def test_nothing_is_left_of_a_block_that_fails(wrong, tmp_path):
    (tmp_path / "a.txt").write_text("old")
    expected = FileError if wrong is OSError else wrong

    def fail():
        with atomic_file(tmp_path / "a.txt") as partial:
            partial.write_text("half")
            raise wrong("in the middle")

    with pytest.raises(expected):
        fail()
    assert (tmp_path / "a.txt").read_text() == "old"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


@pytest.mark.parametrize("name", ["a\0b.h5", "x" * 300])
def test_refuses_impossible_names(name, tmp_path):
    with pytest.raises(FileError), atomic_file(tmp_path / name):
        pass
    with pytest.raises(FileError):
        existing_file(tmp_path / name)


def test_names_the_file_once(tmp_path):
    with pytest.raises(NonFiniteError) as caught, parse_errors(tmp_path, "numbers"), parse_errors(tmp_path, "numbers"):
        raise NonFiniteError("phase: got nan")
    assert str(caught.value) == f"{tmp_path}: phase: got nan"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes with a name")
def test_pipes_and_devices_are_not_opened(tmp_path):
    """Opening a pipe blocks until another process writes to it."""
    os.mkfifo(tmp_path / "a.csv")
    for path in (tmp_path / "a.csv", "/dev/zero"):
        with pytest.raises(BrokenFileError, match="a pipe or a device"):
            existing_file(path)
    with pytest.raises(BrokenFileError, match="a pipe or a device"):
        open_take(tmp_path / "a.csv")


def test_the_actual_reason_is_reported(tmp_path, subtests):
    for wrong, kind, says in [
        (MemoryError("Unable to allocate 8 TiB"), FileError, "more memory than available (Unable to allocate 8 TiB)"),
        (OSError(errno.ENOLCK, "No locks available"), BrokenFileError, "cannot be read: No locks available"),
        (OSError(errno.EIO, "Input/output error"), BrokenFileError, "cannot be read: Input/output error"),
        (OSError("bad object header version number"), BrokenFileError, "damaged or foreign file"),
        (RecursionError("too deep"), BrokenFileError, "damaged or foreign file"),
    ]:
        with subtests.test(says=says), pytest.raises(kind) as told, parse_errors(tmp_path / "a.h5", "a file"):
            raise wrong
        assert type(told.value) is kind
        assert str(told.value).startswith(f"{tmp_path / 'a.h5'}: ")
        assert says in str(told.value)


READ_ONLY = """
set -e
mount -t tmpfs none "$1"
"$2" -c "
import numpy
from midair.files import save
from midair.model import Recording
save(Recording(samples=numpy.ones((9, 4, 4)), rate=1000.0, unit='Pa'), '$1/take.h5')
"
mount -o remount,ro "$1"
"$2" -c "
from midair.errors import FileError
from midair.files import atomic_file, writable_path
for begin in (writable_path, lambda path: atomic_file(path).__enter__()):
    try:
        begin('$1/a.txt')
    except FileError as wrong:
        print(wrong)
"
cd "$1"
"$2" -m midair solve take.h5 2>&1 || true
"""


@pytest.mark.long
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs a system that lends a disk to a test")
def test_a_disk_that_takes_nothing_is_named(tmp_path):
    words = ["unshare", "-rm", "sh", "-c", READ_ONLY, "sh", str(tmp_path), sys.executable]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"no disk to be had: {done.stderr}")
    assert done.stderr == ""
    told = "cannot be written: the folder is read-only; use another one\n"
    # A command says it before its work.
    assert done.stdout == 2 * f"{tmp_path}/a.txt: {told}" + f"midair: take.drive.h5: {told}"


def test_files_that_came_to_be_are_noted_as_they_were_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with collect_written_files() as noted:
        with atomic_file("one.txt") as partial:
            partial.write_text("1")
        with pytest.raises(ZeroDivisionError), atomic_file("never.txt"):
            raise ZeroDivisionError
        with atomic_folder("many") as partial:
            (partial / "a").write_text("a")
    with atomic_file("later.txt") as partial:
        partial.write_text("2")
    assert noted == [Path("one.txt"), Path("many")]


HOLDER = """
import os, sys
from pathlib import Path
from midair.files.atomic import lock_or_raise, lock_recording
file = os.open(sys.argv[2], os.O_RDWR)
lock_or_raise(file, "held") if sys.argv[1] == "hold" else lock_recording(file, Path(sys.argv[2]))
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


@pytest.mark.long
def test_a_file_that_is_recorded_is_not_replaced_but_readable(path):
    with holder("claim", path) as other:
        with pytest.raises(FileError, match="a program is recording into it; wait until"), atomic_file(path):
            pass
        assert path.read_text() == "precious"
        with atomic_file(path, recording=True) as partial:
            partial.write_text("whole")
        other.kill()
    check_not_recording(path)
    assert [each.name for each in path.parent.iterdir()] == ["log"]


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
    done = run("record", "replay:source.h5", "n.h5", "-q")
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
