"""Expected gain of the first pass."""

import numpy as np
import pytest

from midair.model import ControlGrid, PressureFrames, SensorGrid, TransducerArray
from midair.pipeline import required_lead
from midair.rig.correction.first_gain import expected_gain, focus_on_cell
from midair.settings import Settings
from midair.targets import add_lead

BEST = Settings().but(mapping="slow-bias", rate=4000.0, interpolate="pressure", decouple=True, precompensate=True)


def tone(frequency, rate, duration=0.2):
    """A tone in one inner cell, from rest to rest."""
    time = np.arange(round(duration * rate)) / rate
    pressure = np.zeros((len(time), 4, 4))
    pressure[:, 1, 1] = 5 * np.sin(2 * np.pi * frequency * time) * np.sin(np.pi * time / duration)
    return PressureFrames(pressure=pressure, rate=rate, band=(20.0, 470.0))


def gain(settings, frequency=100.0, duration=0.2):
    original = tone(frequency, settings.target.rate, duration)
    return expected_gain(original, add_lead(original, required_lead(settings)), settings)


def test_with_full_compensation_the_gain_is_one():
    assert gain(BEST) == pytest.approx(1, abs=0.01)
    assert gain(BEST.but(gain=2.0)) == pytest.approx(2, abs=0.02)


def test_half_a_wave_is_half_of_it():
    assert gain(BEST.but(mapping="half-wave")) == pytest.approx(0.5, abs=0.02)


def test_held_frames_and_slow_transducers_are_quieter():
    """At 1 kHz a change of 200 Hz loses sinc(.2) = .935 to the hold, and 1 / sqrt(1 + (2 pi 200 188e-6)^2) = .973."""
    slow = BEST.but(rate=1000.0, precompensate=False)
    assert gain(slow, 200.0) / gain(slow, 25.0) == pytest.approx(0.935 * 0.973, abs=0.03)


def test_without_decoupling_pressure_spreads_beyond_the_cell():
    assert gain(BEST.but(decouple=False)) < 0.85


def test_the_strongest_second_of_a_long_recording_counts():
    long = tone(100.0, 1000.0, duration=3.0)
    settings = BEST.but(rate=1000.0)
    assert expected_gain(long, add_lead(long, 0.15), settings) == pytest.approx(1, abs=0.03)


def test_a_focus_presses_less_on_a_cell_than_in_its_middle():
    array = TransducerArray.autd3()
    wide = focus_on_cell(array, SensorGrid(), 5, Settings())
    higher = focus_on_cell(array, SensorGrid(), 5, Settings().but(grid=ControlGrid(height=0.3)))
    assert 0 < higher < wide < 0.5 * 14.7e3


@pytest.mark.parametrize(("rows", "columns", "pitch"), [(3, 3, 11e-3), (4, 4, 6e-3), (2, 3, 13e-3)])
def test_cells_of_any_number_and_pitch(rows, columns, pitch):
    cells = SensorGrid(rows=rows, columns=columns, pitch=pitch)
    wave = tone(100.0, 4000.0).pressure[:, :1, 1:2] + tone(100.0, 4000.0).pressure[:, 1:2, 1:2]
    original = PressureFrames(pressure=wave * np.ones((rows, columns)), rate=4000.0, sensor=cells, band=(20.0, 470.0))
    assert expected_gain(original, add_lead(original, required_lead(BEST)), BEST) == pytest.approx(1, abs=0.02)
