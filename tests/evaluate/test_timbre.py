"""Third octaves: a tone is in its own band, the level has no effect, and white noise rises by 1 dB per band."""

import numpy as np
import pytest

from midair.errors import BandError, InputError
from midair.evaluate import THIRD_OCTAVES, third_octaves
from midair.model import PressureFrames


def pressed(signal, rate=4000.0):
    return PressureFrames(pressure=np.repeat(signal, 16).reshape(-1, 4, 4), rate=rate)


def test_the_bands_are_those_of_the_standard_within_the_band_of_touch():
    named = [25, 31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400]
    assert len(THIRD_OCTAVES) == len(named)
    assert pytest.approx(named, rel=0.01) == THIRD_OCTAVES


@pytest.mark.parametrize("number", range(len(THIRD_OCTAVES)))
def test_a_tone_lies_in_its_own_band(number):
    time = np.arange(4000) / 4000
    levels = third_octaves(pressed(np.sin(2 * np.pi * THIRD_OCTAVES[number] * time)))
    assert levels.argmax() == number
    assert levels[number] == pytest.approx(0, abs=0.5)


def test_level_has_no_effect():
    noise = np.random.default_rng(1).standard_normal(4000)
    assert third_octaves(pressed(1e-3 * noise)) == pytest.approx(third_octaves(pressed(noise)))


def test_white_noise_rises_by_a_decibel_a_band():
    noise = np.random.default_rng(2).standard_normal((7500, 4, 4))
    levels = third_octaves(PressureFrames(pressure=noise, rate=4000.0))
    slope = np.polyfit(np.arange(len(levels)), levels, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)


def test_silence_and_slow_recordings_are_refused():
    with pytest.raises(InputError, match="got silence"):
        third_octaves(pressed(np.zeros(1000)))
    with pytest.raises(BandError):
        third_octaves(pressed(np.ones(1000), rate=500.0))
