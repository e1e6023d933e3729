import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import RateError
from midair.files.timestamps import to_fixed_rate


def test_keeps_rows_that_lie_on_the_grid():
    samples = np.random.default_rng(0).normal(size=(50, 2))
    even = to_fixed_rate(12.5 + np.arange(50) / 100, samples)
    assert even.rate == pytest.approx(100, rel=1e-9)
    np.testing.assert_array_equal(even.samples, samples)
    assert even.report == ()


@given(st.lists(st.sampled_from([27, 28, 29]), min_size=20, max_size=80), st.floats(-5, 5), st.floats(-5, 5))
def test_a_straight_line_stays_one(distances, slope, start):
    """Linear interpolation reproduces a line at any stamps; the rate is that of the mean distance."""
    time = 2133.112 + np.concatenate([[0], np.cumsum(distances)]) / 1e3
    even = to_fixed_rate(time, (start + slope * (time - time[0]))[:, None])
    assert even.rate == pytest.approx(1e3 / np.mean(distances), rel=1e-8)
    seconds = np.arange(len(even.samples)) / even.rate
    np.testing.assert_allclose(even.samples[:, 0], start + slope * seconds, atol=1e-9)
    assert len(even.samples) == len(time)


def test_fills_a_gap_and_reports_it():
    keep = np.r_[0:20, 24:60]
    time = keep / 50
    even = to_fixed_rate(time, keep[:, None].astype(float))
    assert even.rate == 50
    np.testing.assert_allclose(even.samples[:, 0], np.arange(60), atol=1e-9)
    assert even.report[0] == "1 gaps in the time stamps, the longest 100 ms after 0.38 s: filled by straight lines."


def test_drops_rows_with_the_same_stamp():
    time = np.array([0, 1, 1, 2, 3]) / 10
    even = to_fixed_rate(time, np.array([[0.0], [1], [7], [2], [3]]))
    np.testing.assert_array_equal(even.samples, [[0], [1], [2], [3]])
    assert "1 of 5 rows have the time stamp of the row before" in even.report[0]


def test_reports_rows_that_repeat_at_a_later_time():
    even = to_fixed_rate(np.arange(5) / 10, np.array([[0.0, 4], [1, 5], [1, 5], [2, 5], [3, 6]]))
    assert len(even.samples) == 5
    assert "1 of 5 rows repeat every channel" in even.report[0]


def test_uses_the_nominal_rate_when_it_fits():
    time = np.array([0, 28, 56, 85, 113]) / 1e3
    assert to_fixed_rate(time, np.zeros((5, 1)), rate=35.5).rate == 35.5
    with pytest.raises(RateError, match=r"expected about 35\.3982 Hz from the time stamps, got 40 Hz"):
        to_fixed_rate(time, np.zeros((5, 1)), rate=40)


@pytest.mark.parametrize(
    ("time", "message"), [([0, 2, 1], "got 1 s after 2 s"), ([3, 3], "two that differ"), ([1], "two")]
)
def test_refuses_stamps_without_a_rate(time, message):
    with pytest.raises(RateError, match=message):
        to_fixed_rate(np.array(time, float), np.zeros((len(time), 1)))


def test_one_late_stamp_does_not_fill_the_disk():
    """Three rows, the last one three years late: 3.2 GB of straight line, once."""
    with pytest.raises(RateError, match=r"the longest 1e\+08 s after 0\.02 s; check that stamp"):
        to_fixed_rate(np.array([0, 0.01, 0.02, 1e8]), np.zeros((4, 1)))
    with pytest.raises(RateError, match="check that stamp"):
        to_fixed_rate(np.array([0, 0.01, 0.02, 1e300]), np.zeros((4, 1)))


def test_a_pause_between_strokes_is_filled():
    assert len(to_fixed_rate(np.r_[0:500, 10_400:10_900] / 1e3, np.zeros((1000, 1))).samples) == 10_900
    assert len(to_fixed_rate(np.r_[0:2000, 21_000:23_000] / 1e3, np.zeros((4000, 1))).samples) == 23_000
    with pytest.raises(RateError, match="40000 frames"):
        to_fixed_rate(np.r_[0:2000, 43_000:45_000] / 1e3, np.zeros((4000, 1)))
