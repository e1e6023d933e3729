"""Recordings that lose their name, and recordings on a disk that fails, is too small or limits the size of files."""

import errno
import os
import shutil
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from midair.errors import FileError
from midair.files import RecordingWriter, load, open_take, repair, save
from midair.files.native import live_file


@pytest.mark.skipif(os.name == "nt", reason="Windows does not let anybody remove a file that is open")
def test_a_recording_whose_name_is_taken_away_is_rescued(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    said = ""
    try:
        with RecordingWriter(path, **options) as writer:
            writer.append(recording.samples)
            (tmp_path / "other").write_bytes(b"of another program")
            os.replace(tmp_path / "other", path)
    except FileError as wrong:
        said = str(wrong)
    rescued = next(tmp_path.glob("live-rescued-*.h5"))
    assert str(rescued) in said
    alike(load(rescued), recording)
    assert path.read_bytes() == b"of another program"


def test_a_running_recording_is_not_replaced(recording, options, tmp_path, alike):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options) as writer:
        writer.append(recording.samples[:20])
        time.sleep(0.3)
        for replace in (lambda: repair(path), lambda: save(recording, path)):
            with pytest.raises(FileError, match="this program is recording into it"):
                replace()
        writer.append(recording.samples[20:])
    alike(load(path), recording)
    save(recording, path)
    assert sorted(tmp_path.iterdir()) == [path]


READER = """
import sys, h5py
with h5py.File(sys.argv[1], "r", swmr=True) as file:
    for _ in range(2):
        input()
        file["samples"].refresh()
        print(float(file["samples"][:].sum()), len(file["samples"]), flush=True)
"""


@pytest.mark.long
def test_any_program_that_knows_hdf5_reads_it_while_it_grows(recording, options, tmp_path):
    path = tmp_path / "live.h5"
    with RecordingWriter(path, **options, interval=1e-9) as writer:
        writer.append(recording.samples[:20])
        words = [sys.executable, "-c", READER, str(path)]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as reader:
            assert reader.stdin is not None
            assert reader.stdout is not None
            for count in (20, 40):
                reader.stdin.write("\n")
                reader.stdin.flush()
                total, frames = reader.stdout.readline().split()
                assert int(frames) == count
                assert float(total) == pytest.approx(recording.samples[:count].sum())
                writer.append(recording.samples[20:]) if count == 20 else None
        assert reader.returncode == 0


class Refusing:
    """`os.write` of a disk that fails from the n-th write on, a number of times."""

    def __init__(self, error, first, times):
        self.error, self.first, self.last, self.count = error, first, first + times, 0

    def __call__(self, handle, data):
        self.count += 1
        if self.first <= self.count < self.last:
            raise OSError(self.error, os.strerror(self.error))
        return os.write(handle, data)


ERRORS = [errno.EIO, errno.ENOSPC, errno.EDQUOT, errno.EFBIG]
# Each error at every fourth write, so that together they cover every write; the slow tests use each at every write.
SOME = [
    pytest.param(
        each, range(1 + number, 30, 4), id=errno.errorcode[each], marks=[] if number == 0 else pytest.mark.long
    )
    for number, each in enumerate(ERRORS)
]
EVERY = [
    pytest.param(each, (*range(1, 30), 61, 64, 67), id=f"{errno.errorcode[each]}, every write", marks=pytest.mark.slow)
    for each in ERRORS
]


def slow(*sizes):
    return [pytest.param(size, marks=pytest.mark.slow) for size in sizes]


@pytest.mark.parametrize("times", [1, pytest.param(10**9, marks=pytest.mark.long)], ids=["once", "for good"])
@pytest.mark.parametrize(("error", "writes"), [*SOME, *EVERY])
def test_a_disk_error_at_any_write_keeps_the_frames_reported_as_safe(
    error, writes, times, recording, options, tmp_path, monkeypatch
):
    for first in writes:
        path = tmp_path / f"{first}.h5"
        write = Refusing(error, first, times)
        monkeypatch.setattr(live_file, "os", SimpleNamespace(**vars(os) | {"write": write}))
        frames, said = 0, ""
        try:
            with RecordingWriter(path, **options, interval=1e-9) as writer:
                for _ in range(12):
                    writer.append(np.arange(frames, frames + 40)[:, None, None] + recording.samples * 0)
                    frames = writer.frames
        except FileError as wrong:
            said = str(wrong)
        monkeypatch.undo()
        frames = writer.frames
        assert (f"{os.strerror(error)}; the {frames} frames so far are safe" in said) == (write.count >= first)
        if frames == 0:
            assert not path.exists()
            continue
        stored = open_take(path).recording.samples
        assert len(stored) >= frames
        np.testing.assert_array_equal(stored, np.arange(len(stored))[:, None, None] + np.zeros((1, 3, 5)))
        repair(path)
        assert open_take(path).report == ()


SMALL = """
import sys
import numpy as np
from midair.errors import FileError
from midair.files import RecordingWriter
from midair.model import Provenance, SensorGrid
about = dict(rate=1000, sensor=SensorGrid(), unit="V", provenance=Provenance(source="bench"))
writer = RecordingWriter(sys.argv[1], reserve=int(sys.argv[2]), **about)
try:
    with writer:
        for first in range(0, 200_000, 50):
            writer.append(np.arange(first, first + 50)[:, None, None] + np.zeros((1, 4, 4)))
except FileError as wrong:
    print(wrong)
    print(writer.frames)
"""


def written_in(path, *, reserve=2**24, **how):
    """Output of a program that writes as much as possible, and the number of frames that it reports as safe."""
    done = subprocess.run([sys.executable, "-c", SMALL, path, str(reserve)], text=True, capture_output=True, **how)
    assert (done.returncode, done.stderr) == (0, "")
    said, frames = done.stdout.splitlines()
    return said, int(frames)


@pytest.fixture
def tiny_disk(tmp_path):
    """A disk in memory of that many kB."""
    made = []

    def mount(size):
        folder = tmp_path / f"disk{size}"
        folder.mkdir()
        words = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", str(folder)]
        if shutil.which("mount") is None or subprocess.run(words, capture_output=True, check=False).returncode:
            pytest.skip("only root may mount a disk of a chosen size")
        made.append(folder)
        return folder

    yield mount
    for folder in made:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.long
@pytest.mark.parametrize("size", [4, 16384, *slow(16, 32, 128, 1024)])
def test_a_disk_that_is_too_small_gets_no_file(size, tiny_disk):
    folder = tiny_disk(size)
    said, frames = written_in(folder / "live.h5")
    assert "expected 16.78 MB free on the disk" in said
    assert frames == 0
    assert list(folder.iterdir()) == []


@pytest.mark.long
@pytest.mark.parametrize("size", [4, 128, 512, *slow(16, 32, 64, 256, 2048)])
def test_frames_are_kept_on_a_disk_without_reserve(size, tiny_disk):
    folder = tiny_disk(size)
    said, frames = written_in(folder / "live.h5", reserve=0)
    assert "No space left on device" in said
    assert (folder / "live.h5").exists() == (frames > 0)
    assert frames > 0 or size < 512
    if frames:
        assert open_take(folder / "live.h5").recording.frames >= frames


@pytest.mark.long
@pytest.mark.parametrize("limit", [0, 64, 512, *slow(4, 16, 4096)])
def test_a_file_size_limit_keeps_the_safe_frames(limit, tmp_path):
    """As of a shell's ulimit -f, or of 4 GB on FAT32."""
    resource = pytest.importorskip("resource")
    path = tmp_path / "live.h5"
    said, frames = written_in(
        path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit * 1024, limit * 1024))
    )
    assert "File too large" in said
    assert path.exists() == (frames > 0)
    if limit >= 512:
        assert frames * 17 * 8 > 0.5 * limit * 1024
    if frames:
        assert open_take(path).recording.frames >= frames
        np.testing.assert_array_equal(open_take(path).recording.samples[:, 0, 0], np.arange(frames))
