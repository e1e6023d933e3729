from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.calibration.conftest import one_channel

from midair.calibration import CausalInverse, calibrate, causal_error, causal_fir, inverse_response
from midair.dsp import band_edges
from midair.model import Recording
from midair.physics import SensorModel, calibration_of, sense

RATE, BAND = 1000.0, (20.0, 470.0)
MODEL = SensorModel().with_spread(seed=7)
KNOWN = calibration_of(MODEL)


def test_equals_a_regression_on_noise():
    """Regression of noise in the band, delayed by 6 ms, on the same noise through a resonance."""
    length, taps, late = 2**15, 40, 6
    frequency = np.fft.rfftfreq(length, 1 / RATE)
    response = 1 / (1 - (frequency / 320) ** 2 + 0.6j * frequency / 320)
    known = one_channel(response, frequency=frequency)
    pressure = np.fft.rfft(np.random.default_rng(3).standard_normal(length))
    said = np.fft.irfft(pressure * response)
    window = inverse_response(known, frequency, BAND, edges=band_edges(BAND, RATE))[:, 0, 0] * response
    wanted = np.roll(np.fft.irfft(pressure * window), late)
    columns = np.stack([np.roll(said, tap) for tap in range(taps)], axis=1)
    found = np.linalg.lstsq(columns, wanted)[0]
    fir = causal_fir(known, RATE, BAND, delay=late / RATE, taps=taps, below=0.0)[:, 0, 0]
    assert np.sqrt(np.mean((fir - found) ** 2)) < 0.02 * np.abs(fir).max()
    missed = np.sqrt(np.mean((columns @ found - wanted) ** 2) / np.mean(wanted**2))
    (told,) = causal_error(fir.reshape(-1, 1, 1), known, RATE, BAND, delay=late / RATE, parts=[(0.0, 500.0)])
    assert told == pytest.approx(missed, rel=0.05)


def test_the_error_falls_with_the_delay_to_that_of_the_zero_phase_inverse():
    parts = [(30.0, 460.0)]
    error = [
        causal_error(causal_fir(KNOWN, RATE, delay=delay, taps=taps), KNOWN, RATE, delay=delay, parts=parts)[0]
        for delay, taps in ((0.006, 256), (0.03, 256), (0.1, 512))
    ]
    assert error[0] > 4 * error[1] > 16 * error[2]
    assert error[2] < 2e-3
    delays = (0.002, 0.004, 0.006, 0.008, 0.01)
    errors = np.array([causal_error(causal_fir(KNOWN, RATE, delay=d), KNOWN, RATE, delay=d) for d in delays])
    assert (np.diff(errors, axis=0) < 0).all()
    assert (np.diff(errors, axis=1) < 0).all()


def test_a_stream_equals_the_filter_and_is_causal():
    samples = np.random.default_rng(1).standard_normal((700, 4, 4))
    samples[0] = 0.0
    stream = CausalInverse(KNOWN, RATE)
    out = np.concatenate([stream.push(block) for block in np.split(samples, [1, 2, 300])])
    row, column = 2, 1
    direct = lfilter(stream.fir[:, row, column], [1.0], samples[:, row, column])
    assert out[:, row, column] == pytest.approx(direct, abs=1e-9)
    changed = samples.copy()
    changed[400:] += 5.0
    assert np.array_equal(CausalInverse(KNOWN, RATE).push(changed)[:400], out[:400])


def test_slow_pressure_is_removed():
    """A converter's offset gives 0 Pa from the first frame on, a pressure of 1 kPa below the band a thousandth."""
    assert np.abs(CausalInverse(KNOWN, RATE).push(np.full((300, 4, 4), 0.2))).max() < 1e-9
    slow = 1000 * np.sin(2 * np.pi * np.arange(3000) / 3000)[:, None, None] * np.ones((1, 4, 4))
    said = sense(replace(MODEL, noise=0.0), slow, RATE)
    assert np.abs(CausalInverse(KNOWN, RATE).push(said)[600:2400]).max() < 1.0


def test_output_is_the_input_after_the_delay():
    """Band-limited noise in Pa: aligned best with the input 6 ms earlier, with the error of `causal_error`."""
    rng = np.random.default_rng(2)
    pressure = 10 * rng.standard_normal((3000, 4, 4))
    recording = Recording(samples=sense(MODEL, pressure, RATE), rate=RATE)
    zero_phase = calibrate(recording, KNOWN).pressure
    stream = CausalInverse(KNOWN, RATE)
    out = stream.push(recording.samples)
    errors = [np.std(out[500 + late : 2500 + late] - zero_phase[500:2500]) for late in range(12)]
    assert int(np.argmin(errors)) == 6
    (told,) = causal_error(stream.fir, KNOWN, RATE, delay=0.006, parts=[(0.0, 500.0)])
    assert errors[6] / zero_phase.std() == pytest.approx(told, rel=0.15)
