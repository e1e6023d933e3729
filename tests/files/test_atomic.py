import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from midair.errors import BrokenFileError, FileError, NonFiniteError
from midair.files import open_take
from midair.files.atomic import atomic_file, atomic_folder, collect_written_files, existing_file, parse_errors


def test_a_file_appears_when_the_block_ends(tmp_path):
    with atomic_file(tmp_path / "a.txt") as partial:
        partial.write_text("new")
        assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "a.txt").read_text() == "new"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


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


def test_follows_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    with atomic_file(tmp_path / "link.txt") as partial:
        partial.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_has_the_rights_of_any_new_file(tmp_path):
    (tmp_path / "other").touch()
    with atomic_file(tmp_path / "a.txt") as partial:
        partial.write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "other").stat().st_mode


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


def test_takes_the_first_line_of_a_parser(tmp_path):
    with pytest.raises(BrokenFileError) as caught, parse_errors(tmp_path, "a table"):
        raise KeyError("no such\nthing")
    assert "\n" not in str(caught.value)
    assert "expected a table" in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes with a name")
def test_pipes_and_devices_are_not_opened(tmp_path):
    """Opening a pipe blocks until another process writes to it."""
    os.mkfifo(tmp_path / "a.csv")
    for path in (tmp_path / "a.csv", "/dev/zero"):
        with pytest.raises(BrokenFileError, match="a pipe or a device"):
            existing_file(path)
    with pytest.raises(BrokenFileError, match="a pipe or a device"):
        open_take(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("wrong", "kind", "says"),
    [
        (
            MemoryError("Unable to allocate 8 TiB"),
            FileError,
            "needs more memory than available (Unable to allocate 8 TiB)",
        ),
        (OSError(errno.ENOLCK, "No locks available"), BrokenFileError, "cannot be read: No locks available"),
        (OSError(errno.EIO, "Input/output error"), BrokenFileError, "cannot be read: Input/output error"),
        (OSError("bad object header version number"), BrokenFileError, "damaged or foreign file"),
        (RecursionError("too deep"), BrokenFileError, "damaged or foreign file"),
    ],
)
def test_the_actual_reason_is_reported(wrong, kind, says, tmp_path):
    with pytest.raises(kind) as told, parse_errors(tmp_path / "a.h5", "a file"):
        raise wrong
    assert type(told.value) is kind
    assert str(told.value).startswith(f"{tmp_path / 'a.h5'}: ")
    assert says in str(told.value)


READ_ONLY = """
set -e
mount -t tmpfs none "$1"
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
"""


@pytest.mark.long
@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs a system that lends a disk to a test")
def test_a_disk_that_takes_nothing_is_named(tmp_path):
    words = ["unshare", "-rm", "sh", "-c", READ_ONLY, "sh", str(tmp_path), sys.executable]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"no disk to be had: {done.stderr}")
    assert done.stderr == ""
    assert done.stdout == 2 * f"{tmp_path}/a.txt: cannot be written: the folder is read-only; use another one\n"


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
