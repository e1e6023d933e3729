import numpy as np
import pytest

from midair import dsp
from midair.calibration.inverse import default_taps, inverse_response
from midair.model import SensorGrid
from midair.physics import SensorModel, calibration_of
from midair.streaming import LazyFrames, shift_earlier, with_context

RNG = np.random.default_rng(0)
X = RNG.standard_normal((60_000, 2, 2)) + 0.01 * RNG.standard_normal((60_000, 2, 2)).cumsum(axis=0)


@pytest.fixture(autouse=True)
def _many_segments(monkeypatch):
    monkeypatch.setattr("midair.streaming.lazy_filters.BYTES", 2**17)  # 4096 frames


def reel_of(x):
    return LazyFrames(lambda first, last: x[first:last], x.shape)


@pytest.mark.parametrize("rates", [(48_000, 1000), (1000, 375), (1000, 8000), (44_100, 1000)])
def test_another_rate_is_the_same_to_the_last_bit(rates):
    x = X[:20_000]
    np.testing.assert_array_equal(np.asarray(dsp.resample(reel_of(x), *rates)), dsp.resample(x, *rates))


def test_the_same_rate_returns_the_input():
    lazy = reel_of(X)
    assert dsp.resample(lazy, 1000, 1000) is lazy


@pytest.mark.parametrize("frames", [50, 4096, 60_000])
def test_a_convolution_is_the_same_to_rounding(frames):
    fir = RNG.standard_normal((201, 2, 2))
    x = X[:frames]
    want = dsp.filter_fir(x, fir)
    np.testing.assert_allclose(np.asarray(dsp.filter_fir(reel_of(x), fir)), want, atol=1e-12 * np.abs(want).max())


@pytest.mark.parametrize(("rate", "band"), [(1000.0, (20, 470)), (8000.0, (20, 470)), (1000.0, (5, 400))])
def test_a_sensor_is_undone_to_thirty_millionths(rate, band):
    # The response of the inverse after one reach, four periods of its narrowest edge, is -90 dB of the peak.
    calibration = calibration_of(SensorModel(grid=SensorGrid(rows=2, columns=2)))
    edges = dsp.band_edges(band, rate)
    reach = 2 * default_taps(rate, edges) / rate

    def undo(frequency):
        return inverse_response(calibration, frequency, band, edges=edges)

    want = dsp.filter_response(X, rate, undo, reach=reach)
    made = np.asarray(dsp.filter_response(reel_of(X), rate, undo, reach=reach))
    assert np.abs(made - want).max() < 3e-5 * np.abs(want).max()


@pytest.mark.parametrize("frames", [1, 30, 900])
def test_short_and_constant_lazy_frames_equal_arrays(frames):
    def halved(frequency):
        return np.full((len(frequency), 1, 1), 0.5)

    x = X[:frames] + 3
    made = np.asarray(dsp.filter_response(reel_of(x), 1000, halved, reach=0.1))
    np.testing.assert_allclose(made, x / 2, atol=1e-12)


def test_context_is_held_beyond_the_ends():
    def middle(around):
        return sum(around[i : len(around) - 200 + i] for i in range(201)) / 201

    held = np.concatenate([np.repeat(X[:1], 100, axis=0), X, np.repeat(X[-1:], 100, axis=0)])
    np.testing.assert_allclose(np.asarray(with_context(reel_of(X), 100, middle)), middle(held), atol=1e-12)


@pytest.mark.parametrize("by", [0.0, 3.0, -7.25, 2500.5])
def test_lazy_frames_are_shifted_like_an_array(by):
    """White noise less what is above 48 hundredths of the rate."""
    spectrum = np.fft.rfft(X, axis=0)
    spectrum[int(0.48 * len(X)) :] = 0
    x = np.fft.irfft(spectrum, len(X), axis=0)
    # The ends of a cut are no longer band-limited: from silence to silence.
    x[:2000] *= np.hanning(4000)[:2000, None, None]
    x[-2000:] *= np.hanning(4000)[2000:, None, None]
    length = 2 * len(x)
    turn = np.exp(2j * np.pi * np.fft.rfftfreq(length) * by)[:, None, None]
    want = np.fft.irfft(np.fft.rfft(x, length, axis=0) * turn, length, axis=0)[: len(x)]
    assert np.abs(np.asarray(shift_earlier(reel_of(x), by)) - want).max() < 1e-6 * np.abs(want).max()


def test_lazy_frames_have_the_density_of_the_array():
    for resolution in (1.0, 0.003):
        frequency, want = dsp.welch(X, 1000.0, resolution=resolution)
        again, made = dsp.welch(reel_of(X), 1000.0, resolution=resolution)
        np.testing.assert_array_equal(again, frequency)
        np.testing.assert_allclose(made, want, rtol=1e-10)
