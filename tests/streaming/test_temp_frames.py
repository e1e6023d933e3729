import tempfile

import numpy as np
import pytest

from midair.errors import FileError
from midair.streaming import TempFrames


def test_appended_frames_are_read_in_any_order_and_followed_by_zeros():
    x = np.random.default_rng(0).standard_normal((100, 3, 2))
    spool = TempFrames(3, 2)
    spool.append(x[:40])
    np.testing.assert_array_equal(spool.read(10, 30), x[10:30])
    spool.append(x[40:])
    np.testing.assert_array_equal(spool.reel(), x)
    np.testing.assert_array_equal(spool.reel(50).read(35, 45), x[35:45])
    np.testing.assert_array_equal(spool.reel(120).read(90, 110), np.concatenate([x[90:], np.zeros((10, 3, 2))]))


@pytest.mark.filterwarnings("error")
def test_a_full_disk_is_one_line_that_names_the_folder():
    """The message was "File too large", without a file name."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, hard))
    try:
        TempFrames(1).append(np.zeros((2**16, 1)))
        with pytest.raises(
            FileError, match=r"disk space for temporary frames, .* File too large; .* set TMPDIR"
        ) as told:
            TempFrames(1).append(np.zeros((2**18, 1)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert str(told.value).startswith(f"{tempfile.gettempdir()}: ")
