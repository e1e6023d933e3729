import resource
import subprocess
import sys

import pytest

from midair.files.native.hdf5_recovery import RetryingFile

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
