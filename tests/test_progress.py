import numpy as np
import pytest

from midair.progress import report_progress, report_to
from midair.streaming import LazyFrames, blocks


def test_only_the_outermost_loop_reports():
    told = []
    with report_to(lambda done, total: told.append((done, total))):
        for _ in report_progress("ab", 2):
            assert list(report_progress(range(5), 5)) == list(range(5))
        assert list(report_progress([3, 4], 7, weight=lambda each: each)) == [3, 4]
    assert told == [(1, 2), (2, 2), (3, 7), (7, 7)]
    assert list(report_progress("xy", 2)) == ["x", "y"]
    assert len(told) == 4


def test_an_interrupted_loop_lets_the_next_report():
    told = []
    with report_to(lambda done, total: told.append((done, total))):
        for _ in report_progress(range(9), 9):
            break
        with pytest.raises(ZeroDivisionError):
            for each in report_progress([0], 1):
                1 / each
        assert list(report_progress("a", 1)) == ["a"]
    assert told == [(1, 1)]


def test_progress_over_blocks_is_in_frames():
    x = np.arange(20.0).reshape(10, 2)
    for frames in (x, LazyFrames(lambda a, b: x[a:b], x.shape)):
        told = []
        with report_to(lambda done, total, told=told: told.append((done, total))):
            parts = list(blocks(frames, 4))
        assert told == [(4, 10), (8, 10), (10, 10)]
        assert np.array_equal(np.concatenate(parts), x)
