"""Channels one at a time are those of the whole."""

import numpy as np

from midair.channels import channels
from midair.lazy_frames import LazyFrames


def test_each_channel_comes_in_its_order_of_arrays_and_of_reels():
    x = np.random.default_rng(0).standard_normal((100_000, 4, 3))
    reel = LazyFrames(lambda first, last: x[first:last], x.shape)
    for given in (x, reel):
        np.testing.assert_array_equal(np.stack(list(channels(given)), axis=1), x.reshape(len(x), 12))


def test_one_channel_alone_and_none_at_all():
    assert [len(each) for each in channels(np.zeros((5,)))] == [5]
    assert list(channels(np.zeros((5, 0)))) == []
