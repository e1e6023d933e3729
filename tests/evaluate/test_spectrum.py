import numpy as np
import pytest

from midair.evaluate import dominant_frequency


def test_dominant_frequency_ignores_the_mean():
    time = np.arange(500) / 1000
    wave = 10 + np.sin(2 * np.pi * 40 * time) + 0.5 * np.sin(2 * np.pi * 120 * time)
    assert dominant_frequency(wave[:, None, None], 1000.0) == pytest.approx(40.0)
