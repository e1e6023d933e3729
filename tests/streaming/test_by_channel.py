import numpy as np
import pytest

from midair.streaming import LazyFrames, channels, medians

RNG = np.random.default_rng(0)
STEPS = np.round(RNG.standard_normal((30_000, 2, 2)) * 3) / 3
SIGNALS = {
    "noise": np.add(RNG.standard_normal((30_001, 2, 2)), [[0, 5], [-1e6, 1e-9]]),
    "an even number of frames": RNG.standard_normal((30_000, 2, 2)),
    "steps of a converter": STEPS,
    "two values, as many of each": np.repeat([[[1.0, -3.0]], [[2.0, 7.0]]], 500, axis=0),
    "one far away": np.concatenate([RNG.standard_normal((5000, 1)), [[1e300]], [[-1e300]]]),
    "the widest range": np.array([[-1.7e308], [1.7e308], [0.5], [0.25]]),
    "still": np.full((100, 3), 2.5),
    "one frame": np.array([[3.0, 4.0]]),
}


@pytest.mark.parametrize("few", [2**16, 7])
@pytest.mark.parametrize("x", SIGNALS.values(), ids=list(SIGNALS))
def test_they_equal_numpy_bit_by_bit(x, few, monkeypatch):
    monkeypatch.setattr("midair.streaming.lazy_frames._FEW", few)
    monkeypatch.setattr("midair.streaming.lazy_frames.BYTES", 2**15)
    lazy = LazyFrames(lambda first, last: x[first:last], x.shape)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(medians(lazy), np.median(x, axis=0))
        np.testing.assert_array_equal(medians(x), np.median(x, axis=0))


def test_channels_of_arrays_and_lazy_frames_are_in_order():
    x = np.random.default_rng(0).standard_normal((100_000, 4, 3))
    lazy = LazyFrames(lambda first, last: x[first:last], x.shape)
    for given in (x, lazy):
        np.testing.assert_array_equal(np.stack(list(channels(given)), axis=1), x.reshape(len(x), 12))


def test_one_channel_alone_and_none_at_all():
    assert [len(each) for each in channels(np.zeros((5,)))] == [5]
    assert list(channels(np.zeros((5, 0)))) == []
