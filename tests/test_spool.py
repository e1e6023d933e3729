"""Frames that wait on the disk come back as they were."""

import numpy as np

from midair.spool import Columns, Spool


def test_what_is_appended_is_read_again_in_any_order():
    x = np.random.default_rng(0).standard_normal((100, 3, 2))
    with Spool(3, 2) as spool:
        spool.append(x[:40])
        np.testing.assert_array_equal(spool.read(10, 30), x[10:30])
        spool.append(x[40:])
        np.testing.assert_array_equal(spool.reel(), x)
        np.testing.assert_array_equal(spool.reel().read(35, 45), x[35:45])


def test_channels_and_frames_are_two_ways_to_read_the_same():
    x = np.random.default_rng(1).standard_normal((100, 2, 3))
    columns = Columns(100, 6).fill(x)
    np.testing.assert_array_equal(columns.channel(4, 10, 90), x[10:90, 1, 1])
    np.testing.assert_array_equal(columns.reel(2, 3), x)
    columns.put(4, 20, np.ones(5))
    np.testing.assert_array_equal(columns.reel(2, 3)[20:25][:, 1, 1], np.ones(5))
