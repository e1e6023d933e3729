import os
import signal
import subprocess
import sys

from midair.studio.folders import PREFIX, folder_of_session, sweep

HOLDS = """
import sys, time
from pathlib import Path
from midair.studio.folders import folder_of_session
with folder_of_session(Path(sys.argv[1])) as folder:
    print(folder, flush=True)
    time.sleep(60)
"""


def test_folder_is_removed_at_the_end(tmp_path):
    with folder_of_session(tmp_path) as folder:
        (folder / "towel.h5").write_text("x")
        assert folder.name.startswith(PREFIX)
    assert list(tmp_path.iterdir()) == []


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
