import numpy as np
import pytest

from midair.calibration import noise_equivalent_pressure
from midair.calibration.measure.frequency_response import quiet_density, white_level
from midair.errors import BandError
from midair.model import Calibration, Measurement, Recording, SensorGrid


def test_white_noise_has_its_density_and_the_stated_scatter():
    rng = np.random.default_rng(1)
    sensor = SensorGrid(rows=1, columns=300)
    quiet = Recording(samples=0.2 * rng.standard_normal((8000, 1, 300)), rate=1000.0, sensor=sensor)
    frequency, density, averages = quiet_density(quiet, resolution=1.0, width=2.0)
    assert frequency[0] < 4
    assert density.mean() == pytest.approx(0.04 / 500, rel=0.005)
    level, unsure = white_level(density, averages, 2.0)
    score = (level / level.mean() - 1) / unsure
    assert 0.75 < score.std() < 1.25


def flat(noise, *, density=None, response=0.02, sensor=None):
    sensor = sensor or SensorGrid(rows=1, columns=2)
    bins = (3, *sensor.shape)
    zero = np.zeros(sensor.shape)
    measured = None
    if density is not None:
        measured = Measurement(
            coherence=np.ones(bins),
            magnitude_uncertainty=np.zeros(bins),
            phase_uncertainty=np.zeros(bins),
            noise_density=np.broadcast_to(np.reshape(density, (3, 1, 1)), bins),
            noise_uncertainty=zero,
            delay=zero,
            delay_uncertainty=zero,
        )
    return Calibration(
        sensor=sensor,
        frequency=np.array([0.0, 100.0, 500.0]),
        response=np.full(bins, response),
        noise=np.full(sensor.shape, noise),
        measurement=measured,
    )


def test_noise_equivalent_pressure_at_hand_computed_numbers():
    # 20 uV/sqrt(Hz) over 20 mV/Pa in 450 Hz: 1 mPa/sqrt(Hz) * 21.2
    assert noise_equivalent_pressure(flat(20e-6)) == pytest.approx(np.full((1, 2), 1e-3 * np.sqrt(450)))
    # a density that falls from 2 to 0 mPa/sqrt(Hz) over 100 to 500 Hz: sqrt(integral of (2 x/400)^2) = 2 sqrt(400/3)
    slope = flat(0, density=[4e-5, 4e-5, 0])
    assert noise_equivalent_pressure(slope, (100, 500)) == pytest.approx(
        np.full((1, 2), 2e-3 * np.sqrt(400 / 3)), rel=1e-4
    )
    assert np.isinf(noise_equivalent_pressure(flat(1e-6, response=0.0))).all()
    with pytest.raises(BandError, match="within 0 to 500 Hz, got 20 to 600 Hz"):
        noise_equivalent_pressure(flat(1e-6), (20, 600))
