import asyncio
import os
import signal
import subprocess
import sys

import pytest

from midair.errors import InputError, MissingFileError
from midair.studio.folders import PREFIX, StudioFolder, folder_of_session, sweep


@pytest.fixture
def folder(tmp_path):
    inside = tmp_path / "inside"
    (inside / "below").mkdir(parents=True)
    (inside / "take.h5").write_bytes(b"x")
    (inside / "below" / "other.h5").write_bytes(b"x")
    (tmp_path / "secret.h5").write_bytes(b"x")
    os.symlink(tmp_path / "secret.h5", inside / "link.h5")
    os.symlink(tmp_path, inside / "out")
    os.symlink("take.h5", inside / "again.h5")
    return StudioFolder.at(inside)


OUTSIDE = ["../secret.h5", "below/../../secret.h5", "/etc/passwd", "link.h5", "out/secret.h5", "take.h5\0.html"]
OUTSIDE += ["take\n.h5", "..\\secret.h5", "C:secret.h5", "", ".", "below//other.h5", "a" * 5000]
"""Names above the folder, from the root, through links, and those that no file may have."""


def test_files_inside_the_folder_are_found_and_names_that_lead_out_are_refused(folder):
    for name in ["take.h5", "below/other.h5", "again.h5"]:
        assert folder.find(name).read_bytes() == b"x", name
    for name in OUTSIDE:
        with pytest.raises(InputError):
            pytest.fail(f"{name!r} was found: {folder.find(name)}")
    with pytest.raises(MissingFileError, match=r"none\.h5"):
        folder.find("none.h5")
    (folder.path / ".hidden.h5").write_bytes(b"x")
    assert sorted(folder.names(".h5")) == ["again.h5", "take.h5"], "no links to other folders"


def sent(*parts):
    async def come():
        for part in parts:
            yield part

    return come()


def test_upload_gets_a_new_name(folder):
    path = asyncio.run(folder.receive("../../My Take!.csv", sent(b"1,", b"2")))
    assert path.parent == folder.path
    assert (path.name, path.read_bytes()) == ("My Take.csv", b"1,2")
    assert asyncio.run(folder.receive("My Take.h5", sent(b"3"))).name == "My Take-01.h5", "files beside it are its own"
    assert asyncio.run(folder.receive("My Take-01.csv", sent(b"3"))).name == "My Take-02.csv"
    assert asyncio.run(folder.receive("tak\u0301.wav", sent(b"3"))).name == "ta\u1e31.wav"
    assert asyncio.run(folder.receive("...csv", sent(b"3"))).name == "recording.csv"


def test_upload_above_the_limit_or_of_another_kind_is_refused_and_leaves_no_file(folder):
    before = sorted(os.listdir(folder.path))
    taken = []

    async def endless():
        while True:
            taken.append(1)
            yield b"x" * 1000

    with pytest.raises(InputError, match="at most"):
        asyncio.run(folder.receive("take.csv", endless(), largest=10_000))
    assert len(taken) == 11
    for name in ["page.html", "run.py", "take", "take.h5.exe", "a.json"]:
        with pytest.raises(InputError, match="expected a recording"):
            asyncio.run(folder.receive(name, sent(b"x")))
    assert sorted(os.listdir(folder.path)) == before


def test_a_new_folder_is_made_and_a_file_is_refused_as_one(tmp_path):
    assert StudioFolder.at(tmp_path / "takes").path.is_dir()
    (tmp_path / "t.h5").write_text("")
    with pytest.raises(InputError, match=r"expected a folder, got a file; open its folder: midair studio .+"):
        StudioFolder.at(tmp_path / "t.h5")
    with pytest.raises(MissingFileError, match="make it first"):
        StudioFolder.at(tmp_path / "no" / "takes")


HOLDS = """
import sys, time
from pathlib import Path
from midair.studio.folders import folder_of_session
with folder_of_session(Path(sys.argv[1])) as folder:
    print(folder, flush=True)
    time.sleep(60)
"""


@pytest.mark.long
def test_locked_folder_stays_and_that_of_a_killed_studio_is_removed(tmp_path):
    """A killed process leaves its folder, which the next start removes."""
    other = subprocess.Popen([sys.executable, "-c", HOLDS, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    with other:
        folder = other.stdout.readline().strip()
        with folder_of_session(tmp_path) as ours:
            assert sorted(map(str, tmp_path.iterdir())) == sorted([folder, str(ours)])
        other.send_signal(signal.SIGKILL)
        other.wait()
    assert os.path.exists(folder)
    with folder_of_session(tmp_path) as ours:
        assert list(tmp_path.iterdir()) == [ours]
        (ours / "towel.h5").write_text("x")
        assert ours.name.startswith(PREFIX)
    assert list(tmp_path.iterdir()) == [], "it is removed at the end"


def test_other_folders_are_not_removed(tmp_path):
    young, old, elsewhere = (tmp_path / f"{PREFIX}{name}" for name in ("young", "old", "link"))
    other = tmp_path / "other"
    for folder in (young, old, other):
        folder.mkdir()
    elsewhere.symlink_to(other)
    past = old.stat().st_mtime - 3600
    os.utime(old, (past, past))
    assert sweep(tmp_path) == [old]
    assert young.exists()
    assert other.exists()
    assert elsewhere.is_symlink()
