"""Faults of takes that a calibration has to name: two clocks, and a clipped output."""

import numpy as np
import pytest

from midair.calibration import MeasureSettings, Reference, ReferencedTake, measure_calibration, noise_signal
from midair.calibration.measure.frequency_response import clock_drift
from midair.calibration.measure.referenced_take import sweep_signal
from midair.errors import BandError
from midair.model import Recording, SensorGrid

RATE = 1000.0
SETTINGS = MeasureSettings(resolution=2.0)


def at(signal, times):
    """The band-limited signal at times in frames."""
    return np.interp(times, np.arange(16 * len(signal)) / 16, np.fft.irfft(np.fft.rfft(signal), 16 * len(signal)) * 16)


def take(drift=0.0, clip=np.inf, rms=10.0, seed=0):
    """A take of a sensor of 20 mV/Pa whose reference has another clock."""
    rng = np.random.default_rng(seed)
    signal = noise_signal(rms, 13.2, rate=RATE, rng=rng)
    times = 100 + np.arange(13_000)
    volts = 0.02 * signal[times][:, None] + 2e-4 * rng.standard_normal((len(times), 2))
    recording = Recording(
        samples=np.clip(volts, -clip, clip)[:, None], rate=RATE, sensor=SensorGrid(rows=1, columns=2, pitch=0.01)
    )
    pressure = at(signal, 100 + np.arange(13_000) * (1 + drift)) if drift else signal[times]
    return ReferencedTake(recording=recording, reference=Reference(pressure=pressure, rate=RATE, uncertainty=0.005))


def test_a_phase_between_two_clocks_is_within_its_uncertainty_which_is_explained():
    """Before, the phase was off by .2 rad at a stated uncertainty of .018."""
    for drift, told in ((0.0, False), (20e-6, True)):
        found = measure_calibration([take(drift)], settings=SETTINGS)
        off, stated = np.abs(np.angle(found.response)), found.measurement.phase_uncertainty
        assert (off <= 2 * stated).mean() > 0.9
        assert ("clocks of sensor and reference are 20 ppm apart" in found.measurement.method) == told
        assert (np.median(stated) > 0.1) == told


def test_a_drift_is_found_by_its_sign_in_noise_and_not_in_a_sweep():
    for drift in (-100e-6, -5e-6, 5e-6, 100e-6):
        one = take(drift)
        found, error = clock_drift(one.reference.pressure, one.recording.samples[:, 0], RATE)
        assert found == pytest.approx(drift, abs=max(4 * error, 0.02 * abs(drift)))
        assert error < 0.05 * abs(drift)
    swept = sweep_signal(10.0, 12.0, rate=RATE)
    assert clock_drift(swept, np.convolve(swept, [0.5, 0.3, 0.1])[: len(swept), None], RATE) == (0.0, np.inf)


def test_clipped_takes_are_named_also_where_nothing_else_is_left():
    found = measure_calibration([take(seed=1), take(clip=0.4, rms=15.0)], settings=SETTINGS)
    assert found.measurement.method.endswith(
        "clipped, which lowers the response: take 2 (all channels); press less hard there"
    )
    with pytest.raises(BandError, match=r"got 0; clipped, which lowers the response: take 1 \(all channels\)"):
        measure_calibration([take(clip=0.005)], settings=SETTINGS)
