import numpy as np
import pytest

from midair.evaluate import dominant_frequency, spectral_error


def test_a_level_difference_is_itself():
    density = np.random.default_rng(0).random((30, 2)) + 0.1
    assert spectral_error(density, 10 ** (3 / 10) * density) == pytest.approx(3.0, rel=1e-6)


def test_strong_bins_decide():
    original = np.array([1.0, 1e-6])
    assert spectral_error(original, np.array([1.0, 1e-3])) < 0.05
    assert spectral_error(original, np.array([0.1, 1e-6])) == pytest.approx(10, rel=1e-3)


def test_dominant_frequency_ignores_the_mean():
    time = np.arange(500) / 1000
    wave = 10 + np.sin(2 * np.pi * 40 * time) + 0.5 * np.sin(2 * np.pi * 120 * time)
    assert dominant_frequency(wave[:, None, None], 1000.0) == pytest.approx(40.0)
