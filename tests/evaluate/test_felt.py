"""Levels over the detection threshold against published thresholds, and the people who feel them."""

import numpy as np
import pytest

from midair.evaluate import HARDLY_FELT, Felt, felt
from midair.evaluate.felt import _RATE, JUST_FELT, PEOPLE, _level
from midair.physics import TOUCH_CHANNELS

PITCH, SIDE = 2e-3, 15
PLACE = PITCH * (np.arange(SIDE) - SIDE // 2)


def disc(area):
    """A disc on the points, corrected to its area."""
    inside = PLACE**2 + PLACE[:, None] ** 2 < area / np.pi
    return inside * area / (inside.sum() * PITCH**2)


def sine(frequency, frames=400):
    return np.sin(2 * np.pi * frequency * np.arange(frames) / _RATE)[:, None, None]


def threshold(frequency, area):
    """Peak displacement in um of a contact that is just felt, by the more sensitive channel."""
    moved = 1e-6 * sine(frequency) * np.sqrt(disc(area))
    levels = {name: _level(moved, channel, PITCH)[0] for name, channel in TOUCH_CHANNELS.items()}
    # NP I feels the displacement of a place, which does not depend on the corrected area.
    levels["NP I"] -= 10 * np.log10(disc(area).max())
    return 10 ** (-max(levels.values()) / 20)


def just_felt(frequency, area):
    """Peak pressure in Pa on a disc that half of all people feel, by skin."""
    return {name: 10 ** (-each / 20) for name, each in felt(sine(frequency) * disc(area), _RATE, PITCH).levels.items()}


def test_a_contact_has_the_published_thresholds_by_frequency_and_area():
    """Verrillo (1963): flat to 40 Hz, then 12 dB an octave to 250 Hz; 3 dB a doubled area up to 2.9 cm2 above 40 Hz.

    Gescheider et al. (2005, Spatial summation in the tactile sensory system): about 13 dB between .05 and 1.5 cm2 at
    300 Hz.
    """
    large, half = ([20 * np.log10(threshold(each, area)) for each in (25, 40, 125, 250)] for area in (2.9e-4, 1.45e-4))
    assert large == pytest.approx([11.8, 11.8, -8, -20], abs=0.5)
    assert np.subtract(half, large) == pytest.approx([0, 0, 3, 3], abs=0.3)
    assert 20 * np.log10(threshold(300, 0.05e-4) / threshold(300, 1.5e-4)) == pytest.approx(13, abs=2)


@pytest.mark.long
def test_pressure_on_large_and_small_discs_is_felt_as_documented():
    """Radiation force on a reflecting disc of 1.8 cm2 on a finger, .4 mN as a square wave of 200 Hz: Dalecki et al.
    (1995, doi 10.1121/1.411877)."""
    assert just_felt(250, 2.9e-4) == pytest.approx(dict(JUST_FELT), rel=0.06)
    small = just_felt(200, 1.8e-4)
    assert min(small.values()) == pytest.approx(2 / np.pi * 0.4e-3 / 1.8e-4, rel=0.15)
    assert min(just_felt(200, 2.9e-4).values()) * 10 ** (-1.645 * PEOPLE / 20) == pytest.approx(HARDLY_FELT, rel=0.03)


def test_people_who_feel_it_are_those_whose_threshold_is_lower(subtests):
    for level, people in ((0.0, 5), (PEOPLE, 8), (-PEOPLE, 2), (2 * PEOPLE, 10), (float("-inf"), 0)):
        with subtests.test(level=level):
            found = Felt(levels={"soft": level, "stiff": level})
            assert found.people == (people,) * 3
            assert str(found) == f"by about {people} of 10 people (model of skin)"
    spread = Felt(levels={"soft": PEOPLE, "stiff": -PEOPLE})
    assert str(spread) == "by about 5 of 10 people (2 to 8; model of skin)"


@pytest.mark.long
def test_the_strongest_moment_counts_and_steady_pressure_does_not():
    touched = np.zeros((1, 4, 4))
    touched[0, 1, 1] = 10.0
    steady, tone = np.ones((400, 1, 1)), sine(200)
    alone = felt(tone * touched, 1000.0, 11e-3).level
    assert felt((tone + 3 * steady) * touched, 1000.0, 11e-3).level == pytest.approx(alone, abs=0.1)
    # Longer silence, another rate, and a shift by a cell change nothing.
    late = np.concatenate([np.zeros((3000, 4, 4)), tone * touched, np.zeros((400, 4, 4))])
    assert felt(np.roll(late, 1, axis=2), 1000.0, 11e-3).level == pytest.approx(alone, abs=0.5)
    assert felt(steady * touched, 1000.0, 11e-3).people == (0, 0, 0)
