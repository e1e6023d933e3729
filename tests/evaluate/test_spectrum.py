import numpy as np
import pytest

from midair.evaluate import THIRD_OCTAVES, dominant_frequency, spectral_error
from midair.evaluate.spectra import texture


def test_equal_spectra_do_not_differ():
    density = np.random.default_rng(0).random((30, 4, 4))
    assert spectral_error(density, density) == 0


def test_a_level_difference_is_itself():
    density = np.random.default_rng(0).random((30, 2)) + 0.1
    assert spectral_error(density, 10 ** (3 / 10) * density) == pytest.approx(3.0, rel=1e-6)


def test_strong_bins_decide():
    original = np.array([1.0, 1e-6])
    assert spectral_error(original, np.array([1.0, 1e-3])) < 0.05
    assert spectral_error(original, np.array([0.1, 1e-6])) == pytest.approx(10, rel=1e-3)


def test_silence():
    assert spectral_error(np.zeros(3), np.zeros(3)) == 0
    assert spectral_error(np.zeros(3), np.ones(3)) == np.inf


def test_dominant_frequency_ignores_the_mean():
    time = np.arange(500) / 1000
    wave = 10 + np.sin(2 * np.pi * 40 * time) + 0.5 * np.sin(2 * np.pi * 120 * time)
    assert dominant_frequency(wave[:, None, None], 1000.0) == pytest.approx(40.0)


def test_the_bands_are_those_of_the_standard_within_the_band_of_touch():
    named = [25, 31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400]
    assert len(THIRD_OCTAVES) == len(named)
    assert pytest.approx(named, rel=0.01) == THIRD_OCTAVES


@pytest.mark.parametrize("slope", [1.0, 2.0])
def test_the_texture_of_noise_with_a_known_slope(slope):
    """Closed forms: the balance is the ratio of the integrals of f^-s from 100 to 470 and from 20 to 100 Hz."""
    frequency = np.fft.rfftfreq(2**15, 1e-3)
    frequency[0] = np.inf
    white = np.fft.rfft(np.random.default_rng(3).standard_normal((2**15, 2)), axis=0)
    noise = np.fft.irfft(white * frequency[:, None] ** (-slope / 2), axis=0)

    def integral(low, high):
        return np.log(high / low) if slope == 1 else (high ** (1 - slope) - low ** (1 - slope)) / (1 - slope)

    found = texture(noise, 1000.0)
    assert found["spectral slope"] == pytest.approx([slope] * 3, abs=0.06)
    expected = 10 * np.log10(integral(100, 470) / integral(20, 100))
    assert found["balance above over below 100 Hz"] == pytest.approx([expected] * 3, abs=0.5)
    for name, values in texture(1e-3 * noise, 1000.0).items():
        assert values == pytest.approx(found[name], abs=1e-6)


def test_the_envelope_of_a_modulated_tone():
    """1 + m cos: half the square of m, at the frequency of the modulation alone."""
    time = np.arange(4000) / 1000
    tone = (1 + 0.5 * np.cos(2 * np.pi * 16 * time)) * np.sin(2 * np.pi * 150 * time)
    found = texture(tone[:, None], 1000.0)
    assert found["envelope, 8 to 32 Hz"] == pytest.approx([10 * np.log10(0.125)] * 2, abs=0.01)
    assert (found["envelope, 2 to 8 Hz"] < -100).all()
    assert np.isnan(texture(tone[:500, None], 1000.0)["envelope, 2 to 8 Hz"]).all()
    assert not np.isfinite(texture(0 * tone[:, None], 1000.0)["spectral slope"]).any()
