from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import RateError
from midair.recordings import seconds, to_fixed_rate


def test_rows_that_lie_on_the_grid_are_kept_and_a_lost_one_is_a_frame_without_a_number():
    samples = np.random.default_rng(0).normal(size=(50, 2))
    even = to_fixed_rate(12.5 + np.arange(50) / 100, samples)
    assert even.rate == pytest.approx(100, rel=1e-9)
    np.testing.assert_array_equal(even.samples, samples)
    assert even.report == ("Rate 100 Hz: 100 % of 50 rows used, 0 % of 50 frames filled.",)
    keep = np.r_[0:20, 22:60]
    even = to_fixed_rate(keep / 50, keep[:, None].astype(float))
    assert (even.rate, even.missing) == (50, 2)
    np.testing.assert_allclose(even.samples[:, 0], np.where(np.isin(np.arange(60), keep), np.arange(60), np.nan))
    assert even.report == (
        "Rate 50 Hz: 100 % of 58 rows used, 3.33 % of 60 frames filled.",
        "1 gaps in the time stamps, the longest 40 ms after 0.38 s.",
    )


@given(st.lists(st.sampled_from([23, 28, 32]), min_size=20, max_size=80), st.floats(-5, 5), st.floats(-5, 5))
def test_a_straight_line_stays_one(distances, slope, start):
    """Interpolation reproduces a line at any stamps, to within the 5 ms that even rows may deviate from the clock."""
    time = 2133.112 + np.concatenate([[0], np.cumsum(distances)]) / 1e3
    even = to_fixed_rate(time, (start + slope * (time - time[0]))[:, None])
    assert even.rate == pytest.approx(1e3 / np.mean(distances), rel=0.02)
    times = np.arange(len(even.samples)) / even.rate
    np.testing.assert_allclose(even.samples[:, 0], start + slope * times, atol=1e-9 + 5.5e-3 * abs(slope))


def test_rows_under_a_coarse_clock_keep_their_values(subtests):
    """Before, all rows but the first of each stamp were dropped, and the stated rate was refused."""
    samples = np.random.default_rng(1).normal(size=(2000, 1))
    late = np.random.default_rng(0).uniform(0, 4e-4, 200)
    for name, rate, stamp in (
        ("10 ms", 1000, lambda time: np.floor(time * 100) / 100),
        ("ms", 4000, lambda time: np.floor(time * 1e3 + 1e-9) / 1e3),
        ("ms, slower rows", 700, lambda time: np.round(time * 1e3) / 1e3),
        ("ms, faster rows", 1003, lambda time: np.floor(time * 1e3) / 1e3),
        ("packets", 1000, lambda time: np.repeat(time[9::10] + late, 10)),
    ):
        for stated in (None, rate):
            with subtests.test(name=name, stated=stated):
                even = to_fixed_rate(stamp(np.arange(2000) / rate), samples, rate=stated)
                assert even.rate == pytest.approx(rate, rel=5e-4)
                np.testing.assert_array_equal(even.samples, samples)


def test_a_few_rows_with_a_stamp_of_others_are_spread():
    time = np.cumsum(np.random.default_rng(0).uniform(0.6e-3, 1.4e-3, 500))
    even = to_fixed_rate(np.where(np.arange(500) % 50 == 7, np.roll(time, 1), time), time[:, None])
    np.testing.assert_allclose(even.samples[:, 0], time[0] + np.arange(len(even.samples)) / even.rate, atol=1e-3)
    assert even.report[0] == "10 of 500 rows have the time stamp of the row before: they were spread evenly."


def test_rows_that_were_written_twice_are_left_out_and_later_repeats_reported():
    numbers = np.arange(100.0)
    even = to_fixed_rate(np.sort(np.r_[numbers, 7.0, 50.0]), np.sort(np.r_[numbers, 7.0, 50.0])[:, None])
    np.testing.assert_array_equal(even.samples[:, 0], numbers)
    assert even.report[0] == "2 of 102 rows repeat stamp and numbers of the row before: they were left out."
    even = to_fixed_rate(np.arange(5) / 10, np.array([[0.0, 4], [1, 5], [1, 5], [2, 5], [3, 6]]))
    assert len(even.samples) == 5
    assert "1 of 5 rows repeat every channel" in even.report[0]


def test_rows_lost_in_a_stream_are_found_by_its_rate(subtests):
    """Before, a straight line through all stamps made 943 Hz of 1000 Hz."""
    for jitter, lost in product([0.0, 3e-4, 5e-3], [0, 1, 8, 12]):
        with subtests.test(jitter=jitter, lost=lost):
            keep = np.r_[0:1500, 1500 + lost : 4000]
            stamps = keep / 1000 + jitter * np.random.default_rng(2).random(len(keep))
            even = to_fixed_rate(stamps, keep[:, None].astype(float), nominal=1000)
            assert even.rate == pytest.approx(1000, rel=4e-4)
            if lost > 1 or not jitter:
                assert even.missing == lost
                # A late row before the gap may be taken for the first one after it.
                there = np.isfinite(even.samples[:, 0]) & (np.abs(np.arange(4000) - 1500) > 20 * (jitter > 1e-3))
                np.testing.assert_array_equal(even.samples[there, 0], np.arange(4000)[there])


def test_uses_the_stated_rate_when_it_fits():
    time = np.array([0, 28, 56, 85, 113]) / 1e3
    assert to_fixed_rate(time, np.zeros((5, 1)), rate=35.5).rate == 35.5


def test_losses_that_jitter_hides_are_refused(subtests):
    """Each fiftieth row lost: the amplitude of a tone was 12 to 20 % too low."""
    number = np.delete(np.arange(10_000), slice(49, None, 50))
    for jitter in (1e-3, 2e-3):
        time = number / 1000 + np.abs(jitter * np.random.default_rng(1).normal(size=len(number)))
        with subtests.test(jitter=jitter), pytest.raises(RateError, match="losses that can be placed"):
            to_fixed_rate(np.sort(time), np.zeros((len(number), 1)), nominal=1000)


def test_a_true_rate_is_not_refused_for_jitter_packets_of_unlike_sizes_and_stamps_that_say_nothing():
    """Rows 1 ms apart with stamps that are off by .3 ms were taken for 1,099 Hz."""
    tone = np.sin(2 * np.pi * 180 * np.arange(3000) / 1000)
    for jitter in (1e-4, 3e-4, 1e-3):
        rng = np.random.default_rng(1)
        time = np.maximum.accumulate(np.arange(3000) / 1000 + jitter * rng.normal(size=3000))
        even = to_fixed_rate(time, tone[:, None], rate=1000)
        assert (even.rate, even.missing) == (1000, 0), jitter
        np.testing.assert_array_equal(even.samples[:, 0], tone, err_msg=str(jitter))
    # Packets that are stamped at their ends, in 6 s: 1,003 Hz.
    sizes = np.random.default_rng(1).integers(5, 25, 400)
    time = np.repeat(np.cumsum(sizes) / 1000, sizes)[:3000]
    even = to_fixed_rate(time, np.arange(3000.0)[:, None], rate=1000)
    assert (even.rate, len(even.samples)) == (1000, 3000)
    even = to_fixed_rate(np.full(100, 1.696e9), np.arange(100.0)[:, None], rate=1000)
    assert (even.rate, len(even.samples)) == (1000, 100)


NOW = 1_696_000_000


UNITS = [
    ("time [s]", np.arange(50), None, 1, ""),
    ("seconds_elapsed", 0.1 + np.arange(50) / 1e3, None, 1e-3, ""),
    ("time_ms", np.arange(50), None, 1e-3, ""),
    ("Timestamp (us)", np.arange(50) * 1000, None, 1e-3, ""),
    ("t/ns", np.arange(50), None, 1e-9, ""),
    ("time", np.arange(50) / 1e3, None, 1e-3, "s was assumed"),
    ("time", NOW + np.arange(50) / 1e3, None, 1e-3, "s was assumed"),
    ("time", NOW * 1e3 + np.arange(50), None, 1e-3, "ms was assumed"),
    ("time", NOW * 1e6 + np.arange(50) * 1e3, None, 1e-3, "us was assumed"),
    ("time", NOW * 1e9 + np.arange(50) * 1e6, None, 1e-3, "ns was assumed"),
    ("time", np.arange(50), 1000, 1e-3, "ms was assumed"),
    ("time", np.arange(50) * 1000, 1000, 1e-3, "us was assumed"),
    ("time", np.arange(50) * 1e4, 1000, 1e-3, "steps of 1e-07 s fit 1000 Hz"),
]
"""Name of a column, stamps, stated rate, step in s, and what is reported."""


def test_the_unit_of_stamps_is_stated_or_follows_from_size_or_rate(subtests):
    for name, stamps, rate, step, said in UNITS:
        with subtests.test(name=name, first=stamps[0], rate=rate):
            time, report = seconds(np.asarray(stamps, float), name, rate=rate)
            np.testing.assert_allclose(np.diff(time), step, rtol=1e-3)
            assert said in "".join(report)
            assert bool(report) == bool(said)


def test_missing_numbers_stay_missing_between_uneven_stamps():
    time = np.cumsum(np.random.default_rng(0).uniform(0.6e-3, 1.4e-3, 500))
    samples = np.stack([time, time, np.full(500, np.nan)], axis=1)
    samples[100, 0] = np.nan
    even = to_fixed_rate(time, samples)
    assert np.isnan(even.samples).sum(axis=0).tolist() == [2, 0, len(even.samples)]
