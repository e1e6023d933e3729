import numpy as np
import pytest

from midair.calibration.measure.frequency_response import channel_delay, upper_half
from midair.errors import BandError

FREQUENCY = np.arange(100.0, 400.0, 2.0)


def test_a_pure_delay_is_measured():
    response = np.exp(-2j * np.pi * FREQUENCY[:, None] * np.array([0, 1e-4, 3e-3])) * np.array([2, 0.5j, -1])
    delay, unsure = channel_delay(FREQUENCY, response, np.full((150, 3), 0.01))
    assert delay == pytest.approx([0, 1e-4, 3e-3], abs=1e-12)
    # u = .01 / (2 pi sqrt(sum (f - mean)^2)) = .01 / (2 pi 1060.6 Hz)
    assert unsure == pytest.approx(np.full(3, 0.01 / (2 * np.pi * 1060.6)), rel=1e-4)


def test_delays_of_noisy_phases_scatter_as_stated():
    rng = np.random.default_rng(0)
    phase = 0.02 * rng.standard_normal((150, 400)) - 2 * np.pi * 5e-4 * FREQUENCY[:, None]
    delay, unsure = channel_delay(FREQUENCY, np.exp(1j * phase), np.full((150, 400), 0.02))
    assert ((delay - 5e-4) / unsure).std() == pytest.approx(1, abs=0.1)


def test_a_channel_without_response_has_no_delay():
    delay, unsure = channel_delay(FREQUENCY, np.zeros((150, 1)), np.full((150, 1), np.inf))
    assert (delay[0], unsure[0]) == (0, np.inf)
    with pytest.raises(BandError, match="three bins"):
        channel_delay(FREQUENCY[:2], np.ones((2, 1)), np.ones((2, 1)))


def test_the_upper_half():
    assert FREQUENCY[upper_half(FREQUENCY)][0] == 250
    assert len(FREQUENCY[:3][upper_half(FREQUENCY[:3])]) == 3
