import numpy as np
import pytest

from midair.calibration import calibrate, measure_response
from midair.errors import BandError, MismatchError
from midair.model import PressureFrames, Recording, SensorGrid
from midair.physics import SensorModel, channel_response, sense

RATE = 1000.0
MODEL = SensorModel().with_spread(seed=11)


@pytest.fixture(scope="module")
def known():
    """20 s of noise of 10 Pa rms on every cell."""
    noise = 10 * np.random.default_rng(0).standard_normal((20000, 4, 4))
    return PressureFrames(pressure=noise, rate=RATE)


@pytest.fixture(scope="module")
def said(known):
    volts = sense(MODEL, known.pressure, RATE, rng=np.random.default_rng(1))
    return Recording(samples=volts, rate=RATE)


def test_measures_the_sensors_response(known, said):
    calibration = measure_response(said, known)
    frequency = np.linspace(20, 470, 91)
    wanted = channel_response(MODEL, frequency)
    error = np.abs(calibration.response_at(frequency) - wanted) / np.abs(wanted)
    assert error.max() < 0.02
    assert np.median(error) < 0.003


def test_finds_the_sensors_noise(known):
    loud = SensorModel(noise=2e-3)
    volts = sense(loud, known.pressure, RATE, rng=np.random.default_rng(1))
    calibration = measure_response(Recording(samples=volts, rate=RATE), known)
    assert calibration.noise == pytest.approx(np.full((4, 4), 2e-3), rel=0.15)


def test_the_measured_calibration_inverts_the_sensor(known, said):
    calibration = measure_response(said, known, date="2026-01-31")
    other = 10 * np.random.default_rng(5).standard_normal((3000, 4, 4))
    volts = sense(MODEL, other, RATE, rng=np.random.default_rng(6))
    heard = calibrate(Recording(samples=volts, rate=RATE), calibration)
    wanted = calibrate(Recording(samples=other, rate=RATE, unit="Pa"))
    middle = slice(500, -500)
    error = heard.pressure[middle] - wanted.pressure[middle]
    assert np.sqrt(np.mean(error**2) / np.mean(wanted.pressure[middle] ** 2)) < 0.01
    assert heard.provenance.steps[-1].settings["calibration_date"] == "2026-01-31"


def test_only_coherent_bins_count(known):
    # above 300 Hz there is only the sensor's noise
    window = np.fft.rfftfreq(20000, 1 / RATE) < 300
    slow = np.fft.irfft(np.fft.rfft(known.pressure, axis=0) * window[:, None, None], axis=0)
    volts = sense(MODEL, slow, RATE, rng=np.random.default_rng(1))
    calibration = measure_response(Recording(samples=volts, rate=RATE), PressureFrames(pressure=slow, rate=RATE))
    assert calibration.frequency[0] <= 6
    assert 296 <= calibration.frequency[-1] <= 304
    with pytest.raises(BandError, match="within the calibration's"):
        calibrate(Recording(samples=volts, rate=RATE), calibration)


def test_a_dead_channel_has_no_response(known, said):
    samples = np.array(said.samples)
    samples[:, 2, 3] = 0.1
    calibration = measure_response(Recording(samples=samples, rate=RATE), known)
    assert not calibration.response[:, 2, 3].any()
    assert (np.abs(np.delete(calibration.response.reshape(-1, 16), 11, axis=1)) > 0).all()


def test_unrelated_or_absent_signals_are_refused(known, said):
    unrelated = Recording(samples=np.random.default_rng(9).standard_normal((20000, 4, 4)), rate=RATE)
    with pytest.raises(BandError, match=r"coherence of 0\.9 on every live channel, got 0"):
        measure_response(unrelated, known)
    with pytest.raises(BandError, match="got 0"):
        measure_response(Recording(samples=np.zeros((20000, 4, 4)), rate=RATE), known)
    with pytest.raises(BandError, match="got 0"):
        measure_response(said, PressureFrames(pressure=np.zeros((20000, 4, 4)), rate=RATE))


@pytest.mark.parametrize(
    "other",
    [
        PressureFrames(pressure=np.ones((20000, 4, 4)), rate=500.0),
        PressureFrames(pressure=np.ones((19999, 4, 4)), rate=RATE),
        PressureFrames(pressure=np.ones((20000, 2, 4)), rate=RATE, sensor=SensorGrid(rows=2)),
    ],
)
def test_a_pressure_that_does_not_fit_is_refused(said, other):
    with pytest.raises(MismatchError, match="20000 frames at 1000 Hz"):
        measure_response(said, other)
