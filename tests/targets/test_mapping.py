import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import maximum_filter1d

from midair.targets import MAPPINGS, MappingStream, SlowBias, constant_offset, half_wave, mapping_of, slow_bias

WAVES = sorted(set(MAPPINGS) - {"receptors"})
"""Mappings that keep the waveform."""
RATES = st.sampled_from([500.0, 1000.0, 4000.0])


def noise(frames=400, seed=0):
    return np.random.default_rng(seed).normal(size=(frames, 2, 3))


def test_a_mapping_is_not_negative_goes_with_the_pressure_and_takes_each_cell_alone(subtests):
    for name, to_push in MAPPINGS.items():
        with subtests.test(name=name):
            pushed = to_push(noise(), 1000.0)
            assert pushed.shape == (400, 2, 3)
            assert pushed.min() >= 0
            np.testing.assert_allclose(to_push(2 * noise(), 1000.0), 2 * pushed, atol=1e-12)
            np.testing.assert_array_equal(to_push(noise()[:, 1:], 1000.0), pushed[:, 1:])
            if name in WAVES:
                np.testing.assert_array_equal(to_push(np.abs(noise()), 1000.0), np.abs(noise()))


def test_offsets_biases_and_half_waves_by_hand():
    np.testing.assert_array_equal(constant_offset(np.array([[1.0], [-2.0], [-5.0]]), offset=3.0), [[4.0], [1.0], [0.0]])
    # The sliding maximum over 90 ms of a 25 Hz sine is its amplitude; so is its smooth form: P = x + 1.
    x = np.sin(2 * np.pi * 25 * np.arange(1000) / 1000)[:, None]
    np.testing.assert_allclose(slow_bias(x, 1000.0)[100:-100], x[100:-100] + 1, atol=1e-12)
    # x+ = A (1/pi + sin / 2 - 2/pi sum cos(2 k w t) / (4 k^2 - 1)).
    lines = np.abs(np.fft.rfft(half_wave(10 * np.sin(2 * np.pi * 50 * np.arange(4000) / 4000)), norm="forward"))
    assert lines[[0, 50, 100, 200]] == pytest.approx(10 * np.array([1, np.pi / 4, 1 / 3, 1 / 15]) / np.pi, rel=1e-2)


def test_one_pull_is_bounded_by_a_plateau_with_shoulders_that_are_smooth_above_the_corner():
    """Sliding maximum over 91 frames, smoothed over 91: from 90 frames before to 90 after, 1 at the top: no cut."""
    x = np.zeros((401, 1))
    x[200] = -1
    bias = slow_bias(x, 1000.0)[:, 0]
    assert (np.flatnonzero(bias)[0], np.flatnonzero(bias)[-1]) == (110, 290)
    hann = np.hanning(93)[1:-1] / np.hanning(93).sum()
    # at frame 140 the window from 95 to 185 sees the plateau from 155 to 245 with its last 31 weights
    assert bias[140] == pytest.approx(hann[-31:].sum(), abs=1e-12)
    # at the minimum itself all 91 weights are on the plateau
    assert bias[199] == pytest.approx(1 - hann[0], abs=1e-12)
    assert bias[200] == pytest.approx(0, abs=1e-12)
    hann = SlowBias(corner=8.0).hann(40e3)
    at = np.abs(np.sum(hann * np.exp(2j * np.pi * 8.0 * np.arange(len(hann)) / 40e3)))
    assert 20 * np.log10(at) == pytest.approx(-3.01, abs=0.05)


def test_the_bias_follows_the_band(subtests):
    """The distortion just above the lower corner is that just above 20 Hz: the bias contains no vibration."""
    for band in [(20.0, 470.0), (1.0, 15.0), (5.0, 100.0)]:
        with subtests.test(band=band):
            rate, low = 50 * band[0], band[0]
            time = np.arange(round(20 / low * rate)) / rate
            x = (np.sin(2 * np.pi * 1.5 * low * time) * (1 + 0.5 * np.sin(2 * np.pi * 0.3 * low * time)))[:, None]
            pushed = mapping_of("slow-bias", band)(x, rate)
            inside = slice(len(x) // 4, -len(x) // 4)
            bias = (pushed - x)[inside]
            spectrum = np.abs(np.fft.rfft((bias - bias.mean())[:, 0] * np.hanning(len(bias))))
            frequency = np.fft.rfftfreq(len(bias), 1 / rate)
            wave = np.abs(np.fft.rfft(x[inside, 0] * np.hanning(len(bias)))).max()
            assert spectrum[frequency >= low].max() < 0.02 * wave
            assert mapping_of("half-wave", band) is half_wave


@settings(max_examples=25, deadline=None)
@given(RATES, st.floats(5e-3, 0.1), st.integers(0, 2**32 - 1))
def test_nothing_is_cut(rate, window, seed):
    """P - x is the bias itself, at least -x and at least 0, and at most the largest pull."""
    x = np.random.default_rng(seed).normal(size=(300, 1))
    added = SlowBias(corner=0.72 / window)(x, rate) - x
    assert (added >= np.maximum(-x, 0) - 1e-12).all()
    assert added.max() <= max(0, -x.min()) + 1e-12


@settings(max_examples=25, deadline=None)
@given(RATES, st.integers(0, 2**32 - 1))
def test_the_bias_never_moves_faster_than_its_smoothing_allows(rate, seed):
    """|b[i + 1] - b[i]| <= (range of the sliding maximum) * (largest weight): a mean whose window moves by one."""
    x = np.random.default_rng(seed).normal(size=(300, 1))
    reach = slow_bias.reach(rate)
    held = np.pad(x, ((reach, reach), (0, 0)), mode="edge")
    pulls = maximum_filter1d(np.maximum(-held, 0), reach + 1, axis=0)
    pushed = slow_bias(x, rate)
    uncut = ((pushed > 0)[1:] & (pushed > 0)[:-1])[:, 0]
    moved = np.abs(np.diff(pushed - x, axis=0))[uncut]
    assert moved.max(initial=0) <= np.ptp(pulls) * slow_bias.hann(rate).max() + 1e-12


OFFSET = {"constant-offset": {"offset": 2.5}}
BLOCKS = st.lists(st.integers(1, 200), min_size=1, max_size=6)


def stream(name, rate=1000.0):
    return MappingStream(name, rate, **OFFSET.get(name, {}))


def offline(name, pressure, rate=1000.0):
    return constant_offset(pressure, **OFFSET[name]) if name in OFFSET else MAPPINGS[name](pressure, rate)


@settings(max_examples=25, deadline=None)
@given(blocks=BLOCKS, seed=st.integers(0, 2**32 - 1))
def test_all_blocks_together_equal_the_whole(blocks, seed):
    pressure = np.random.default_rng(seed).normal(size=(sum(blocks), 2, 2))
    for name in WAVES:
        one = stream(name)
        out = [one.push(block) for block in np.split(pressure, np.cumsum(blocks)[:-1])]
        whole, found = offline(name, pressure), np.concatenate([*out, one.finish()])
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-12, err_msg=name)


def test_frames_go_out_exactly_the_stated_delay_later():
    pressure = np.random.default_rng(1).normal(size=(300, 1, 1))
    for name, delay in (("half-wave", 0), ("constant-offset", 0), ("slow-bias", 90)):
        one = stream(name)
        assert one.delay == delay, name
        out = np.concatenate([one.push(frame[None]) for frame in pressure])
        np.testing.assert_allclose(out, offline(name, pressure)[: 300 - delay], rtol=0, atol=1e-12, err_msg=name)


def test_a_stream_of_a_lower_band_is_as_much_later_and_one_begins_again_after_its_end():
    band, pressure = (5.0, 100.0), np.random.default_rng(4).normal(size=(900, 1, 1))
    one = MappingStream("slow-bias", 500.0, band=band)
    assert one.delay == 180
    out = np.concatenate([one.push(pressure[:500]), one.push(pressure[500:]), one.finish()])
    np.testing.assert_allclose(out, mapping_of("slow-bias", band)(pressure, 500.0), rtol=0, atol=1e-12)
    pressure = np.random.default_rng(3).normal(size=(200, 1, 1))
    one = stream("slow-bias")
    first = np.concatenate([one.push(pressure), one.finish()])
    again = np.concatenate([one.push(pressure), one.finish()])
    np.testing.assert_array_equal(first, again)
