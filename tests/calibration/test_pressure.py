import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.calibration import calibrate
from midair.datasets import sample
from midair.dsp import band_edges, band_window, filter_response
from midair.errors import BandError
from midair.model import Calibration, Provenance, Recording, SensorGrid
from midair.physics import SensorModel, calibration_of, sense
from midair.recordings import dead_channels

RATE = 1000.0
BAND = (20.0, 470.0)
MODEL = SensorModel().with_spread(seed=7)
CALIBRATION = calibration_of(MODEL)


def noise(seed, frames=2400, rise=300):
    """10 Pa rms of white pressure with silence at both ends."""
    ramp = np.sin(np.pi / 2 * np.clip(np.minimum(np.arange(frames), np.arange(frames)[::-1]) / rise, 0, 1)) ** 2
    return 10 * np.random.default_rng(seed).standard_normal((frames, 4, 4)) * ramp[:, None, None]


def recorded(pressure, *, rng=None):
    samples = sense(MODEL, pressure, RATE, rng=rng)
    return Recording(samples=samples, rate=RATE, provenance=Provenance(source="virtual", simulated=True))


def within_band(pressure):
    window = lambda f: band_window(f, BAND, edges=band_edges(BAND, RATE))[:, None, None]  # noqa: E731
    return filter_response(pressure, RATE, window, reach=0.4)


def relative(a, b):
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


def of(values, **changes):
    return Recording(**({"samples": values, "rate": RATE, "unit": "Pa"} | changes))


def tone(frequency, frames=1000, offset=0.0):
    wave = np.sin(2 * np.pi * frequency * np.arange(frames) / RATE) + offset
    return np.broadcast_to(wave[:, None, None], (frames, 4, 4))


def test_recovers_the_pressure_on_the_sensor_but_for_its_noise():
    for seed in range(3):
        pressure = noise(seed)
        quiet = calibrate(recorded(pressure), CALIBRATION).pressure
        assert relative(quiet, within_band(pressure)) < 1e-3, seed
    heard = calibrate(recorded(pressure, rng=np.random.default_rng(0)), CALIBRATION).pressure
    # 20 uV/sqrt(Hz) over 20 mV/Pa in 450 Hz: 21 mPa rms; the signal has 9 Pa
    assert (heard - quiet).std() == pytest.approx(0.022, rel=0.15)


@pytest.mark.long
@settings(deadline=None, max_examples=10)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 100))
def test_is_linear(seed, factor):
    samples = np.random.default_rng(seed).standard_normal((300, 4, 4))
    one = calibrate(of(samples, unit="V"), CALIBRATION).pressure
    more = calibrate(of(factor * samples, unit="V"), CALIBRATION).pressure
    assert more == pytest.approx(factor * one, rel=1e-9, abs=1e-9 * factor * np.abs(one).max())


def test_an_offset_makes_no_difference_and_the_whole_band_changes_nothing():
    samples = np.random.default_rng(0).standard_normal((600, 4, 4))
    flat = Calibration.flat(SensorGrid(), sensitivity=8.0, unit="count")
    plain = calibrate(of(samples, unit="count"), flat).pressure
    offset = calibrate(of(samples + 2048, unit="count"), flat).pressure
    assert offset == pytest.approx(plain, abs=1e-9)
    pressure = np.random.default_rng(0).standard_normal((501, 4, 4)) + 3
    assert calibrate(of(pressure), band=(0, 500)).pressure == pytest.approx(pressure, abs=1e-9)


@pytest.mark.long
def test_a_recording_in_pascals_only_passes_the_band():
    pressure = noise(2)
    assert calibrate(of(pressure)).pressure == pytest.approx(within_band(pressure), abs=1e-5)
    same = calibrate(of(pressure), Calibration.flat(SensorGrid(), unit="Pa")).pressure
    assert same == pytest.approx(calibrate(of(pressure)).pressure)


def test_a_slow_recording_takes_another_band_and_one_beyond_the_calibration_is_refused():
    time = np.arange(400) / 35.6
    slow = np.broadcast_to((10 * np.sin(2 * np.pi * 2 * time) ** 2)[:, None, None], (400, 4, 4))
    frames = calibrate(of(slow, rate=35.6), band=(0.5, 15.0))
    assert frames.rate == 35.6
    assert frames.pressure[100:300] == pytest.approx(slow[100:300] - 5, abs=0.1)
    short = calibration_of(MODEL, highest=300.0)
    with pytest.raises(BandError, match="calibration's 0 to 300 Hz, got 20 to 470 Hz"):
        calibrate(of(noise(0), unit="V"), short)
    assert calibrate(of(noise(0), unit="V"), short, band=(20, 290)).band == (20, 290)


def test_a_real_recording_of_denim():
    denim = sample("denim")
    flat = Calibration.flat(denim.sensor, unit="count")
    with pytest.raises(BandError, match=r"half the recording's rate of 35\.\d+ Hz.*such as"):
        calibrate(denim, flat)
    frames = calibrate(denim, flat, band=(0.5, 15.0))
    assert np.isfinite(frames.pressure).all()
    # the offset of each taxel is gone, its vibration is not
    quarter = frames.frames // 4
    middle, raw = frames.pressure[quarter:-quarter], denim.samples[quarter:-quarter]
    alive = ~dead_channels(denim)
    assert np.abs(middle.mean(axis=0)).max() < 0.05 * raw.mean(axis=0).max()
    assert (middle.std(axis=0)[alive] > 0).all()
    assert not frames.provenance.simulated


def test_provenance_records_the_settings_and_a_dead_channel_that_stays_silent():
    recording = recorded(noise(0))
    frames = calibrate(recording, CALIBRATION)
    step = frames.provenance.steps[-1]
    assert step.stage == "calibrate"
    assert step.settings["band_hz"] == frames.band == BAND
    assert step.settings["edges_hz"] == (10.0, 23.5)
    assert step.settings["calibration"] == CALIBRATION.provenance.source
    assert frames.provenance.simulated
    assert frames.provenance.source == "virtual"
    # Also with a real recording, if the calibration is simulated.
    assert calibrate(of(noise(0), unit="V"), CALIBRATION).provenance.simulated
    assert not calibrate(of(noise(0))).provenance.simulated
    samples = np.array(recorded(noise(0)).samples)
    samples[:, 1, 3] = 0.7
    frames = calibrate(of(samples, unit="V"), CALIBRATION)
    assert frames.provenance.steps[-1].settings["dead_channels"] == (7,)
    assert np.abs(frames.pressure[:, 1, 3]).max() < 1e-9


def test_a_short_tap_anywhere_a_weak_texture_on_a_strong_drift_and_a_short_recording_are_detected():
    heard = {}
    for start in (5, 50, 2000, 3000, 3955):
        samples = np.zeros((4000, 4, 4))
        samples[start : start + 40, 0, 0] = np.hanning(40)
        heard[start] = calibrate(of(samples)).pressure[start : start + 40, 0, 0]
        assert heard[start].max() > 0.3
    assert heard == {start: pytest.approx(heard[2000], abs=1e-3) for start in heard}
    samples = 100 * tone(3.0) + 0.5 * tone(100.0)
    assert calibrate(of(samples)).pressure[300:700] == pytest.approx(0.5 * tone(100.0)[300:700], abs=0.15)
    # Shorter than the filter.
    frames = calibrate(of(tone(100.0, frames=60)))
    assert frames.frames == 60
    assert frames.pressure[20:40] == pytest.approx(tone(100.0, frames=60)[20:40], abs=0.3)


def test_a_tone_keeps_amplitude_and_phase():
    time = np.arange(2000) / RATE
    pressure = np.zeros((2000, 4, 4))
    rise = np.sin(np.pi / 2 * np.clip(np.minimum(time, 2 - time) / 0.3, 0, 1)) ** 2
    for frequency in (25.0, 100.0, 250.0, 450.0):
        pressure[:, 2, 1] = 50 * np.sin(2 * np.pi * frequency * time) * rise
        heard = calibrate(recorded(pressure), CALIBRATION).pressure
        assert heard[500:1500, 2, 1] == pytest.approx(pressure[500:1500, 2, 1], abs=0.06), frequency
        assert np.abs(np.delete(heard.reshape(2000, 16), 9, axis=1)).max() < 1e-6, frequency
