"""Blind calibration bench: the code under test does not know the true sensor, the tests compare with it."""

import numpy as np
import pytest

from midair.model import Calibration, SensorGrid
from midair.physics import SensorModel, channel_response
from midair.rig.bench.calibration_page import CalibrationBench


def one_channel(response, noise=0.0, frequency=(0.0, 1e3)):
    """Calibration of a sensor of one cell, with one response at all frequencies or one for each."""
    response = np.broadcast_to(np.reshape(response, (-1, 1, 1)), (len(frequency), 1, 1))
    sensor, noise = SensorGrid(rows=1, columns=1), np.full((1, 1), noise)
    return Calibration(sensor=sensor, frequency=np.array(frequency), response=response, noise=noise)


@pytest.fixture(scope="package")
def blind_model():
    def make(seed, **changes):
        delay = np.random.default_rng(seed + 1000).uniform(0, 3e-4, (4, 4))
        return SensorModel(delay=delay, **changes).with_spread(seed=seed)

    return make


@pytest.fixture(scope="package")
def bench(blind_model):
    def make(seed, *, model=None, **changes):
        return CalibrationBench(model=model or blind_model(seed), seed=seed, **changes)

    return make


@pytest.fixture(scope="package")
def covered():
    """Shares of bins in 20 to 470 Hz and channels whose true magnitude and phase are within k = 2."""

    def share(calibration, model):
        frequency, measured = calibration.frequency, calibration.measurement
        band = (frequency >= 20) & (frequency <= 470)
        ratio = calibration.response[band] / channel_response(model, frequency[band])
        magnitude = np.abs(np.abs(ratio) - 1) < 2 * measured.magnitude_uncertainty[band]
        phase = np.abs(np.angle(ratio)) < 2 * measured.phase_uncertainty[band]
        return magnitude.mean(), phase.mean()

    return share
