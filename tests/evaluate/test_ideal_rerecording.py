from dataclasses import replace

import numpy as np
import pytest

from midair.dsp import band_edges, band_window
from midair.evaluate import apply_band_twice, band_settling_frames, compare
from midair.model import PressureFrames
from midair.targets import add_lead

RATE, BAND = 1000.0, (20.0, 470.0)


def noise(frames=400):
    pressure = np.random.default_rng(0).standard_normal((frames, 4, 4))
    return PressureFrames(pressure=pressure, rate=RATE, band=BAND)


def test_each_frequency_passes_the_edges_of_the_band_once_more():
    for frequency in (15.0, 18.0, 20.0, 25.0, 100.0, 470.0, 475.0):
        wave = np.cos(2 * np.pi * frequency * np.arange(4000) / RATE) * np.hanning(4000)
        x = PressureFrames(pressure=wave[:, None, None] * np.ones((1, 4, 4)), rate=RATE, band=BAND)
        part = band_window(np.array([frequency]), BAND, edges=band_edges(BAND, RATE))[0] * np.linalg.norm(x.pressure)
        off = 0.01 * np.linalg.norm(wave)
        assert np.linalg.norm(apply_band_twice(x).pressure) == pytest.approx(part, abs=off), frequency


def test_uses_the_edges_of_the_calibration():
    """At 4 kHz the edges can be wider than at the sensor's 1 kHz."""
    wide, narrow = noise(), noise()
    narrow = replace(narrow, provenance=narrow.provenance.then("calibrate", {"edges_hz": (1.0, 2.0)}))
    assert compare(apply_band_twice(wide), apply_band_twice(narrow)).waveform_error > 0.03


def test_pressure_without_a_band_is_unchanged_and_silence_is_kept_for_four_periods():
    x = replace(noise(), band=None)
    assert apply_band_twice(x) is x
    assert band_settling_frames(BAND, RATE) == 200
    assert band_settling_frames((0.0, 15.0), 100.0) == 400


def test_a_lead_that_ends_in_silence_hides_the_ends():
    """With a lead, the part inside does not depend on the signal assumed beyond the ends."""
    x = add_lead(noise(), 0.15)
    longer = replace(x, pressure=np.concatenate([np.zeros((500, 4, 4)), x.pressure, np.zeros((500, 4, 4))]))
    inside = apply_band_twice(longer).pressure[500:-500]
    np.testing.assert_allclose(apply_band_twice(x).pressure, inside, atol=1e-3)
