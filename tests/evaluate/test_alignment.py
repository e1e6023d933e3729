import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.evaluate import advance, find_delay

RATE = 1000.0


def burst(delay):
    time = np.arange(512) / RATE - delay
    return (np.exp(-(((time - 0.25) / 0.03) ** 2)) * np.sin(2 * np.pi * 60 * time))[:, None, None]


@given(st.floats(-0.02, 0.02))
def test_finds_a_delay_of_any_part_of_a_frame_and_takes_it_back(delay):
    assert find_delay(burst(0.0), burst(delay), RATE) == pytest.approx(delay, abs=2e-5)
    np.testing.assert_allclose(advance(burst(delay), delay, RATE), burst(0.0), atol=1e-6)


def test_finds_a_part_of_a_frame_in_dense_noise():
    """Noise up to .47 of the rate, which has a very narrow correlation."""
    noise = np.fft.rfft(np.random.default_rng(8).normal(size=(2000, 3)), axis=0)
    noise[np.fft.rfftfreq(2000, 1 / RATE) > 470] = 0
    x, delays = np.fft.irfft(noise, 2000, axis=0), [(3 + part) / RATE for part in (-0.45, -0.2, 0.1, 0.3, 0.5)]
    assert [find_delay(x, advance(x, -each, RATE), RATE) for each in delays] == pytest.approx(delays, abs=3e-6)


def test_silence_and_the_other_way_round_have_no_delay_and_the_edge_of_the_search_is_found():
    assert find_delay(burst(0.0), np.zeros((512, 1, 1)), RATE) == 0.0
    assert find_delay(burst(0.0), -burst(0.0), RATE, longest=0.001) == 0.0
    assert find_delay(burst(0.0), burst(0.004), RATE, longest=0.004) == pytest.approx(0.004)
