import numpy as np

from midair.streaming import LazyFrames, channels


def test_channels_of_arrays_and_lazy_frames_are_in_order():
    x = np.random.default_rng(0).standard_normal((100_000, 4, 3))
    lazy = LazyFrames(lambda first, last: x[first:last], x.shape)
    for given in (x, lazy):
        np.testing.assert_array_equal(np.stack(list(channels(given)), axis=1), x.reshape(len(x), 12))


def test_one_channel_alone_and_none_at_all():
    assert [len(each) for each in channels(np.zeros((5,)))] == [5]
    assert list(channels(np.zeros((5, 0)))) == []
