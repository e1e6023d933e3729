import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.fft import next_fast_len
from scipy.signal import firwin, resample_poly, welch

from midair import dsp
from midair.errors import BandError
from midair.streaming import LazyFrames

RATE = 1000.0
PAPER = (20.0, 470.0)
seeds = st.integers(0, 2**32 - 1)


def smooth_noise(seed, frames=2000, rise=300):
    """Noise that starts and ends at rest."""
    ramp = np.sin(np.pi / 2 * np.clip(np.minimum(np.arange(frames), np.arange(frames)[::-1]) / rise, 0, 1)) ** 2
    return np.random.default_rng(seed).standard_normal((frames, 2)) * ramp[:, None]


def paper_window(f):
    return dsp.band_window(f, PAPER, edges=(10.0, 23.5))[:, None]


@given(st.integers(1, 2**40))
def test_fast_lengths_are_those_of_scipy(least):
    assert dsp.fast_length(least) == next_fast_len(least, real=True)


def test_the_window_at_hand_computed_places():
    f = np.array([0, 15, 17.5, 20, 22.5, 25, 100, 458.25, 470, 481.75, 500])
    quarter = 0.5 - np.sqrt(0.125)
    wanted = [0, 0, quarter, 0.5, 1 - quarter, 1, 1, 1, 0.5, 0, 0]
    assert dsp.band_edges(PAPER, RATE) == (10.0, 23.5)
    assert dsp.band_window(f, PAPER, edges=(10.0, 23.5)) == pytest.approx(wanted)


@pytest.mark.long
@given(st.floats(0.01, 0.9), st.floats(0.05, 1), st.floats(1, 1e5))
def test_usual_edges_always_fit(low, high, rate):
    band = (low * high * rate / 2, high * rate / 2)
    edges = dsp.band_edges(band, rate)
    window = dsp.band_window(np.linspace(0, rate / 2, 200), band, edges=edges)
    assert 0 <= window.min() <= window.max() <= 1
    assert dsp.band_window(np.array(band), band, edges=edges) == pytest.approx([0.5, 0.5 if edges[1] else 1])


def test_the_refusal_names_the_rate_and_a_band_that_fits():
    with pytest.raises(BandError, match=r"17\.8 Hz.*35\.6 Hz.*20 to 470 Hz.*such as 0\.18 to 16 Hz") as refusal:
        dsp.check_band(PAPER, 35.6)
    low, high = str(refusal.value).removesuffix(" Hz").rsplit("such as ", 1)[1].split(" to ")
    assert dsp.check_band((float(low), float(high)), 35.6)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_a_unit_response_changes_nothing(seed):
    x = np.random.default_rng(seed).standard_normal((101, 2))
    same = dsp.filter_response(x, RATE, lambda f: np.ones((len(f), 1)), reach=0.1)
    assert same == pytest.approx(x, abs=1e-12)


def test_lazy_frames_are_filtered_as_an_array_is():
    window = lambda f: dsp.band_window(f, (5.0, 400.0), edges=(5.0, 20.0))[:, None]  # noqa: E731
    for frames in (1, 30, 20_000):
        x = 3 + np.random.default_rng(0).standard_normal((frames, 2)).cumsum(axis=0)
        lazy = LazyFrames(lambda first, last, x=x: x[first:last], x.shape)
        made = np.asarray(dsp.filter_response(lazy, RATE, window, reach=0.8))
        wanted = dsp.filter_response(x, RATE, window, reach=0.8)
        assert np.abs(made - wanted).max() <= 3e-5 * np.abs(wanted).max() + 1e-12, frames


def test_a_delay_is_a_delay():
    x = smooth_noise(0)
    late = dsp.filter_response(x, RATE, lambda f: np.exp(-2j * np.pi * f * 0.007)[:, None], reach=0.1)
    # half a sample of the highest bin cannot turn; whole frames can
    assert late[7:] == pytest.approx(x[:-7], abs=1e-12)


def test_a_tone_in_the_band_passes_without_delay_and_one_outside_goes():
    time = np.arange(3000) / RATE

    def through(f):
        x = np.sin(2 * np.pi * f * time)[:, None]
        return x[1000:2000], dsp.filter_response(x, RATE, paper_window, reach=0.4)[1000:2000]

    for f in (25.0, 100.0, 450.0):
        x, y = through(f)
        assert y == pytest.approx(x, abs=2e-3)
    for f in (2.0, 12.0, 490.0):
        x, y = through(f)
        assert np.abs(y).max() < 2e-3


def test_a_constant_offset_makes_no_step():
    x = np.full((500, 1), 2048.0)
    assert np.abs(dsp.filter_response(x, RATE, paper_window, reach=0.4)).max() < 1e-9
    cut = np.fft.irfft(np.fft.rfft(x[:, 0], 1000) * paper_window(dsp.fft_frequencies(1000, RATE))[:, 0])[:500]
    assert np.abs(cut).max() > 500  # what zeros around it would have done


def test_extension_holds_and_fades():
    held = dsp.extend(np.array([[2.0], [3.0]]), 4)[:, 0]
    assert held == pytest.approx([0, 1, 2, 2, 2, 3, 3, 3, 1.5, 0])
    assert dsp.extend(np.array([1.0]), 0).tolist() == [1.0]


def test_a_tones_energy_is_in_its_band():
    for frequency in [40.0, 100.0, 333.0]:
        x = 3 * np.sin(2 * np.pi * frequency * np.arange(4000) / RATE)
        assert dsp.band_energy(x, RATE, (20, 470)) == pytest.approx(4.5, rel=0.01)
        assert dsp.band_energy(x, RATE, (frequency + 8, 470)) < 1e-8
    # A drift does not leak into the band.
    time = np.arange(2000) / RATE
    drift = 1000 * time**2 + 500 * np.sin(2 * np.pi * 2 * time)
    assert dsp.band_energy(drift, RATE, PAPER) < 1e-6 * drift.var()


def test_resampling_is_that_of_scipy():
    for up, down in [(4, 1), (1, 4), (7, 3)]:
        x = np.random.default_rng(0).standard_normal((900, 2))
        fir = firwin(128 * max(up, down) + 1, 1 / max(up, down), window=("kaiser", 8.0))
        wanted = resample_poly(x, up, down, window=fir, padtype="edge")
        whole = dsp.resample(x, RATE, RATE * up / down)
        np.testing.assert_allclose(whole, wanted, atol=1e-12)
        for part in slice(40), slice(101, 190), slice(len(whole) - 30, None):
            assert (dsp.resample(x, RATE, RATE * up / down, part=part) == whole[part]).all()


def test_spectra_are_those_of_scipy():
    for segment in [250, 251]:
        x = np.random.default_rng(0).standard_normal((1001, 2)) + 3
        frequency, density = dsp.welch(x, RATE, resolution=RATE / segment)
        wanted = welch(x.T, RATE, nperseg=segment)
        np.testing.assert_allclose(frequency, wanted[0], atol=1e-12)
        np.testing.assert_allclose(density.T, wanted[1], atol=1e-15)
        how = {"window": "blackmanharris", "nperseg": segment, "noverlap": 3 * segment // 4}
        power = welch(x.T, RATE, **how)[1].sum(axis=1) * RATE / segment
        np.testing.assert_allclose(dsp.band_energy(x, RATE, (0, 500), resolution=RATE / segment), power, atol=1e-14)


@pytest.mark.long
def test_resampling_keeps_lengths_constants_and_the_same_rate():
    assert dsp.resample(np.full((36, 2), 7.0), 35.6, 1000.0) == pytest.approx(np.full((1012, 2), 7.0), abs=2e-3)
    x = smooth_noise(1)
    assert (dsp.resample(x, 1000.0, 1000.0) == x).all()
    # 8000 / 35.6 is 20000 / 89 exactly: an hour of frames does not drift
    assert len(dsp.resample(np.zeros(80000), 8000.0, 35.6)) == 356
