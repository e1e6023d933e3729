import numpy as np
import pytest

from midair.calibration import clipped_share, dead_channels
from midair.errors import InputError
from midair.model import Recording
from midair.physics import SensorModel, channel_response, sense


def recording(samples):
    return Recording(samples=samples, rate=1000.0)


def test_a_constant_channel_is_dead():
    samples = np.random.default_rng(0).standard_normal((50, 4, 4))
    samples[:, 1, 2] = 3.0
    samples[:, 3, 0] = 0.0
    assert np.argwhere(dead_channels(recording(samples))).tolist() == [[1, 2], [3, 0]]


def test_the_virtual_sensor_clips_where_it_is_told():
    time = np.arange(1000) / 1000
    pressure = np.zeros((1000, 4, 4))
    pressure[:, 0, 0] = 400 * np.sin(2 * np.pi * 53.7 * time)  # 8 V where 5 fit
    pressure[:, 0, 1] = 100 * np.sin(2 * np.pi * 53.7 * time)
    volts = sense(SensorModel(), pressure, 1000.0, rng=np.random.default_rng(0))
    swing = 400 * np.abs(channel_response(SensorModel(), np.array([53.7]))[0, 0, 0])
    for shares in (clipped_share(recording(volts), full_scale=5.0), clipped_share(recording(volts))):
        assert shares[0, 0] == pytest.approx(2 / np.pi * np.arccos(5 / swing), abs=0.01)
        assert (shares.ravel()[1:] == 0).all()


def test_runs_of_two_and_dead_channels_are_not_clipping():
    samples = np.zeros((8, 4, 4))
    samples[:, 0, 0] = [0, 1, 1, 0, -1, -1, 0, 1]
    samples[:, 0, 1] = [0, 1, 1, 1, 0, 0, -1, 0]
    samples[:, 0, 2] = [-2, -2, -2, -2, 0, 0, 0, 1]
    assert clipped_share(recording(samples))[0].tolist() == [0, 3 / 8, 4 / 8, 0]
    assert clipped_share(recording(samples[:2]))[0].tolist() == [0, 0, 0, 0]


def test_the_limit_must_be_positive():
    with pytest.raises(InputError, match="full scale"):
        clipped_share(recording(np.zeros((3, 4, 4))), full_scale=0.0)
