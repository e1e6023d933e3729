"""Frames that wait on the disk come back as they were."""

import numpy as np

from midair.spool import Spool


def test_what_is_appended_is_read_again_in_any_order():
    x = np.random.default_rng(0).standard_normal((100, 3, 2))
    with Spool(3, 2) as spool:
        spool.append(x[:40])
        np.testing.assert_array_equal(spool.read(10, 30), x[10:30])
        spool.append(x[40:])
        np.testing.assert_array_equal(spool.reel(), x)
        np.testing.assert_array_equal(spool.reel().read(35, 45), x[35:45])
