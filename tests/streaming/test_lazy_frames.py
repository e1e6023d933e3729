import numpy as np
import pytest

from midair.errors import ShapeError
from midair.model import AmplitudeFrames, ControlGrid
from midair.streaming import BYTES, LazyFrames, block_ranges, blocks, cached_blocks, concatenate_lazy, each_frame
from midair.validation import frozen_array

X = np.random.default_rng(0).standard_normal((1000, 2, 3)).cumsum(axis=0) + 40


def reel_of(x, asked=None):
    def read(first, last):
        if asked is not None:
            asked.append((first, last))
        return x[first:last]

    return LazyFrames(read, x.shape)


def test_lazy_frames_read_like_the_array():
    lazy = reel_of(X)
    known = (len(lazy), lazy.shape, lazy.ndim, lazy.size, lazy.nbytes, lazy.dtype)
    assert known == (1000, (1000, 2, 3), 3, 6000, 48000, "f8")
    np.testing.assert_array_equal(lazy, X)
    np.testing.assert_array_equal(lazy[-1], X[-1])
    np.testing.assert_array_equal(lazy[:, 1, 2], X[:, 1, 2])
    assert lazy.max() == X.max()
    with pytest.raises(IndexError):
        lazy[1000]
    assert repr(lazy) == "<LazyFrames 1000 x 2 x 3>"


def test_a_slice_of_lazy_frames_reads_nothing():
    asked = []
    part = reel_of(X, asked)[100:400][50:-50]
    assert isinstance(part, LazyFrames)
    assert (asked, len(part)) == ([], 200)
    np.testing.assert_array_equal(part.read(10, 20), X[160:170])
    assert (asked, len(reel_of(X)[700:100])) == ([(160, 170)], 0)
    np.testing.assert_array_equal(np.asarray(reel_of(X)[::7]), X[::7])


def test_blocks_are_all_frames_in_order():
    for x in (X, reel_of(X)):
        parts = list(blocks(x, 300))
        assert [len(part) for part in parts] == [300, 300, 300, 100]
        np.testing.assert_array_equal(np.concatenate(parts), X)


def test_a_block_is_about_eight_megabytes_and_one_frame_at_least():
    assert next(block_ranges((10**9, 4, 4))) == (0, BYTES // 128)
    assert list(block_ranges((2, 10**8))) == [(0, 1), (1, 2)]


def test_each_frame_maps_arrays_and_lazy_frames_alike():
    def doubled(block):
        return 2 * block.reshape(len(block), -1)

    np.testing.assert_array_equal(np.asarray(each_frame(reel_of(X), doubled)), each_frame(X, doubled))


def test_segments_are_fixed_and_the_last_ones_are_kept():
    made = []

    def make(first, last):
        made.append((first, last))
        return X[first:last]

    lazy = cached_blocks(make, X.shape, size=300, kept=2)
    np.testing.assert_array_equal(lazy.read(250, 650), X[250:650])
    np.testing.assert_array_equal(lazy.read(640, 900), X[640:900])
    assert made == [(0, 300), (300, 600), (600, 900)]
    np.testing.assert_array_equal(lazy.read(0, 10), X[:10])
    assert made[-1] == (0, 300)
    assert lazy.read(5, 5).shape == (0, 2, 3)
    np.testing.assert_array_equal(np.asarray(lazy), X)


def test_data_classes_accept_lazy_frames_and_check_their_shape():
    lazy = reel_of(X)
    grid = ControlGrid(rows=2, columns=3)
    flat = LazyFrames(lambda first, last: X[first:last].reshape(-1, 6), (1000, 6))
    assert AmplitudeFrames(amplitude=flat, rate=10, grid=grid).amplitude is flat
    assert frozen_array(lazy, "x", ("frame", 2, 3)) is lazy
    with pytest.raises(ShapeError, match="axes"):
        frozen_array(lazy, "x", ("frame", 3, 3))


def test_consecutive_frames_are_read_together_in_blocks(monkeypatch):
    asked = []
    some = np.array([5, 6, 7, 900, 3, 4, 4, -2, -1])
    np.testing.assert_array_equal(reel_of(X, asked)[some], X[some])
    assert asked == [(5, 8), (900, 901), (3, 5), (4, 5), (998, 1000)]
    chosen = X[:, 0, 0] > 40
    np.testing.assert_array_equal(reel_of(X)[chosen], X[chosen])
    assert reel_of(X)[np.zeros(0, int)].shape == (0, 2, 3)
    monkeypatch.setattr("midair.streaming.lazy_frames.BYTES", 8 * 6 * 400)
    asked.clear()
    np.testing.assert_array_equal(reel_of(X, asked)[np.arange(1000)], X)
    assert asked == [(0, 400), (400, 800), (800, 1000)]


def test_single_frames_do_not_keep_the_segments_that_they_lie_in():
    made = []

    def make(first, last):
        made.append(np.full((last - first, 3), float(first)))
        return made[-1]

    lazy = cached_blocks(make, (1000, 3), size=100, kept=1)
    some = lazy[np.array([5, 250, 999])]
    np.testing.assert_array_equal(some[:, 0], [0.0, 200.0, 900.0])
    assert some.base is None
    assert not any(np.shares_memory(some, each) for each in made)


def test_a_concatenation_is_lazy_if_a_part_is():
    parts = [X[:300], reel_of(X[300:310]), reel_of(X[310:])]
    whole = concatenate_lazy(parts)
    np.testing.assert_array_equal(whole, X)
    np.testing.assert_array_equal(whole.read(299, 311), X[299:311])
    assert len(whole.read(310, 310)) == 0
    assert isinstance(concatenate_lazy([X, X]), np.ndarray)
