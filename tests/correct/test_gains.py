from dataclasses import replace

import numpy as np
import pytest

from midair.correct import amplitude_gain, beam_drive, beam_gain, commanded_pressure, correct_air, sine_amplitude
from midair.model import Acoustics, Drive, Medium, TransducerArray
from midair.physics import propagate, radiation_pressure
from midair.streaming import LazyFrames

ARRAY = TransducerArray.autd3()
POINT = np.array([0.0055, -0.0055, 0.2])


def test_the_beam_beats_as_a_raised_sine_of_pressure_whose_amplitude_is_found():
    levels = np.array([0.1, 0.3])
    drive = beam_drive(ARRAY, POINT, levels, frequency=100.0, cycles=20, rate=1000.0)
    field = propagate(drive, POINT[None])[:, 0]
    pressure = radiation_pressure(field, Medium())
    full = commanded_pressure(ARRAY, POINT, levels)
    time = np.arange(200) / 1000
    expected = full[:, None] * (1 - np.cos(2 * np.pi * 100 * time)) / 2
    np.testing.assert_allclose(pressure, expected.ravel(), rtol=1e-9, atol=1e-9)
    time = np.arange(600) / 1000
    signal = np.repeat([2.0, 4.0, 8.0], 200) * (1 - np.cos(2 * np.pi * 100 * time)) / 2
    np.testing.assert_allclose(sine_amplitude(signal, 1000.0, frequency=100.0, parts=3), [1, 2, 4], rtol=1e-9)


def test_a_straight_line_is_found_with_its_floor_and_an_amplitude_gain_is_bounded():
    commanded = np.linspace(10, 60, 6)
    line = beam_gain(commanded, 0.4 * commanded + 3)
    assert line.gain == pytest.approx(0.4)
    assert line.intercept == pytest.approx(3)
    assert amplitude_gain(0.5) == 2
    assert amplitude_gain(0.001) == 4
    assert amplitude_gain(100.0, limit=8) == 1 / 8


@pytest.mark.long
def test_the_error_of_the_gain_is_its_spread():
    """Over many noisy repeats, the gains scatter as the mean stated error says."""
    rng, commanded = np.random.default_rng(0), np.linspace(10, 60, 6)
    lines = [beam_gain(commanded, 0.4 * commanded + rng.normal(0, 0.5, 6)) for _ in range(2000)]
    scatter = np.std([line.gain for line in lines])
    stated = np.sqrt(np.mean([line.gain_error**2 for line in lines]))
    assert stated == pytest.approx(scatter, rel=0.08)


TWO_UNITS = TransducerArray.autd3(columns=1, rows=1)
CENTRE = np.array([0.01, -0.02, 0.2])
# Only the speed of sound differs, so that the field at the centre has a closed form: that of the air before.
BEFORE = Acoustics(medium=Medium(speed=345.0), directivity="point")
ROOM = Medium(speed=347.5)


def drive(frames=5):
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, (frames, TWO_UNITS.count))
    return Drive(phase=phase, level=np.full(frames, 0.5), rate=1000.0, array=TWO_UNITS, acoustics=BEFORE)


def test_the_field_at_the_centre_is_that_of_the_air_it_was_solved_for():
    before = drive()
    after = correct_air(before, ROOM, CENTRE)
    wanted = propagate(before, CENTRE[None])
    np.testing.assert_allclose(propagate(after, CENTRE[None]), wanted, rtol=1e-9)
    # Without the correction it is another field.
    uncorrected = propagate(before, CENTRE[None], acoustics=after.acoustics)
    assert np.abs(uncorrected - wanted).max() > 0.1 * np.abs(wanted).max()
    np.testing.assert_array_equal(after.level, before.level)
    assert after.acoustics.medium == ROOM
    assert after.provenance.last("correct_air") == {"from_m_s": 345.0, "to_m_s": 347.5}


def test_lazy_phases_are_corrected_block_by_block_and_the_same_air_changes_nothing():
    whole = drive(50)
    lazy = replace(whole, phase=LazyFrames(lambda first, last: whole.phase[first:last], whole.phase.shape))
    after = correct_air(lazy, ROOM, CENTRE)
    assert isinstance(after.phase, LazyFrames)
    np.testing.assert_array_equal(np.asarray(after.phase), correct_air(whole, ROOM, CENTRE).phase)
    np.testing.assert_allclose(correct_air(drive(), BEFORE.medium, CENTRE).phase, drive().phase, atol=0)
