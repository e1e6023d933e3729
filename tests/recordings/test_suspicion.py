import numpy as np
import pytest

from midair.model import Recording
from midair.recordings.suspicion import suspicious


@pytest.fixture
def samples():
    """Sines, slow against the rate, on 16 channels."""
    time = np.arange(2000) / 1000
    return np.stack([np.sin(2 * np.pi * 20 * time + i) for i in range(16)], axis=1)


def report(samples):
    return suspicious(Recording(samples=samples.reshape(-1, 4, 4), rate=1000, unit="count"))


def test_says_nothing_of_channels_that_speak(samples):
    assert report(samples) == ()


def test_names_silent_and_saturated_channels(samples):
    samples[:, 3], samples[:, 9] = 0, 65535
    assert report(samples) == ("Channels that never change, dead or saturated: 3 (0 count), 9 (65535 count).",)


def test_names_a_white_floor(samples):
    samples[:, 5] = 1e-3 * np.random.default_rng(0).normal(size=2000)
    assert report(samples) == ("Channels that hold only a white floor, more than ten times below the others: 5.",)


def test_a_quiet_signal_is_no_floor(samples):
    samples[:, 5] *= 1e-3
    assert report(samples) == ()


def test_loud_noise_is_no_floor(samples):
    """White signals are allowed: a sponge may sound like one."""
    assert report(np.random.default_rng(0).normal(size=samples.shape)) == ()


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_does_not_depend_on_the_scale(scale, samples):
    samples[:, 3] = 0
    assert len(report(samples * scale)) == 1
