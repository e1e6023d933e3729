import resource
import subprocess
import sys

import h5py
import numpy as np
import pytest

from midair.files import RecordingWriter, load, save
from midair.files.native.hdf5_recovery import RetryingFile, checksum, closed_file, closed_image, is_unclosed


def test_checksum_is_lookup3():
    """The number printed by the author of lookup3 for this text and initial value 0."""
    assert checksum(b"Four score and seven years ago") == 0x17770551


def test_checksum_is_that_of_hdf5(recording, tmp_path):
    for name, frames in (("a", 1), ("b", 7), ("c", 40)):
        path = tmp_path / f"{name}.h5"
        save(type(recording)(samples=recording.samples[:frames], rate=1, sensor=recording.sensor), path)
        block = path.read_bytes()[:48]
        assert checksum(block[:44]) == int.from_bytes(block[44:], "little")


def test_a_damaged_superblock_is_not_taken_for_an_unclosed_one(recording, tmp_path):
    path = tmp_path / "a.h5"
    save(recording, path)
    data = bytearray(path.read_bytes())
    data[11] = 5
    path.write_bytes(data)
    assert not is_unclosed(path)
    with pytest.raises(OSError, match="expected"):
        load(path)


@pytest.mark.parametrize("large", [0, 10**9], ids=["the file itself", "a copy"])
def test_an_unclosed_file_is_read_in_place_when_it_is_large(large, recording, tmp_path):
    path = tmp_path / "live.h5"
    with RecordingWriter(
        path, rate=1000, sensor=recording.sensor, unit="V", provenance=recording.provenance, interval=1e-9
    ) as writer:
        writer.append(recording.samples)
        assert is_unclosed(path)
        before = path.read_bytes()
        with closed_file(path, large=large) as source:
            with h5py.File(source, "r") as file:
                np.testing.assert_array_equal(file["samples"], recording.samples)
            source.seek(0)
            whole = bytearray(len(before))
            assert source.readinto(whole) == len(before)
            assert bytes(whole) == closed_image(path)
        assert path.read_bytes() == before
    assert not is_unclosed(path)


WRITE = """
import resource, signal, sys
import numpy as np
from midair.errors import FileError
from midair.files import save
from midair.model import Recording
from midair.streaming import LazyFrames

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
noise = np.random.default_rng(0).standard_normal((200_000, 4, 4))
try:
    save(Recording(samples=LazyFrames(lambda a, b: noise[a:b], noise.shape), rate=1000), sys.argv[1])
except FileError as wrong:
    print(wrong)
"""


@pytest.mark.long
@pytest.mark.parametrize("most", [100, 5_000, 3_000_000, 20_000_000])
def test_a_file_that_may_not_grow_is_refused_in_one_line_and_the_old_one_stays(tmp_path, most):
    path = tmp_path / "long.h5"
    path.write_bytes(b"old")
    done = subprocess.run(
        [sys.executable, "-c", WRITE, str(path), str(most)], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{path}: cannot be written: File too large\n"
    assert [each.name for each in tmp_path.iterdir()] == ["long.h5"]
    assert path.read_bytes() == b"old"


def test_it_accepts_all_bytes_and_raises_the_disk_error_at_the_end(tmp_path):
    with RetryingFile(tmp_path / "a") as patient:
        assert patient.write(b"abc") == 3
        patient.check()
    assert (tmp_path / "a").read_bytes() == b"abc"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4, limits[1]))
    try:
        with RetryingFile(tmp_path / "b") as patient:
            assert patient.write(b"abcdef") == 6
            assert patient.write(b"more") == 4
            with pytest.raises(OSError, match="File too large"):
                patient.check()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
