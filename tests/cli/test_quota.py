"""Files that commands leave when a disk quota is exceeded (btrfs; needs root)."""

import shutil
import subprocess
import sys

import pytest

from midair.files import open_take

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("mkfs.btrfs") is None, reason="no mkfs.btrfs (btrfs-progs)"),
]


def told(*line):
    return subprocess.run(line, capture_output=True, text=True, check=False)


@pytest.fixture
def four_megabytes(tmp_path):
    """A folder of 4 MB on a disk of 200 MB."""
    image, disk = tmp_path / "disk.img", tmp_path / "disk"
    disk.mkdir()
    with image.open("wb") as file:
        file.truncate(200 * 2**20)
    made = told("mkfs.btrfs", "-q", image)
    if made.returncode or told("mount", "-o", "loop", image, disk).returncode:
        pytest.skip("no disk can be made or mounted here")
    try:
        folder = disk / "mine"
        for line in (["quota", "enable", disk], ["subvolume", "create", folder], ["qgroup", "limit", "4M", folder]):
            assert told("btrfs", *line).returncode == 0
        yield folder
    finally:
        told("umount", disk)


def midair(folder, *words):
    return subprocess.run(
        [sys.executable, "-m", "midair", *map(str, words)], capture_output=True, text=True, check=False, cwd=folder
    )


def test_a_quota_ends_a_recording_in_order_and_leaves_no_half_of_another_file(four_megabytes):
    done = midair(four_megabytes, "record", "virtual:towel", "take.h5", "--duration", "120s")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("midair: ")
    assert "quota exceeded; the " in done.stderr.splitlines()[-1].lower()
    safe = int(done.stderr.split("the ")[-1].split(" frames")[0])
    assert safe > 10_000
    assert open_take(four_megabytes / "take.h5").recording.frames == safe
    for words in (
        ["export", "take.h5", "take.csv"],
        ["show", "take.h5", "--save", "page.html"],
        ["cut", "take.h5", "part.h5", "--end", "40s"],
        ["solve", "take.h5", "d.drive.h5", "--duration", "1s", "--mode", "quick"],
    ):
        done = midair(four_megabytes, *words)
        assert done.returncode == 1, done.stderr
        assert "quota exceeded" in done.stderr.splitlines()[-1].lower()
        assert "Traceback" not in done.stderr
        assert [each.name for each in four_megabytes.iterdir()] == ["take.h5"], words
