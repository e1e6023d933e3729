"""Duty and warming, compared with closed forms of heat conduction and means that are counted by hand."""

import numpy as np
import pytest

from midair.model import Acoustics, Drive, TransducerArray
from midair.physics import focus_phase, palm_warming, skin_warming, transfer_matrix, unit_duty, unit_levels
from midair.physics.exposure_places import PUBLISHED_RISE, STRONG_FOCUS

ARRAY = TransducerArray.autd3()
PALM = np.array([[0.0, 0.0, 0.2]])


def still(seconds, level=1.0, rate=10.0):
    phase = np.asarray(focus_phase(ARRAY, PALM[0])).reshape(1, -1)
    return Drive(
        phase=np.repeat(phase, round(seconds * rate), axis=0),
        level=np.full(round(seconds * rate), level),
        rate=rate,
        array=ARRAY,
    )


def test_a_unit_is_averaged_over_the_busiest_minute():
    level = np.zeros((90, 2))
    level[:30, 0], level[40:80, 1] = 1.0, 0.5
    assert unit_duty(level, 1.0) == pytest.approx([30 / 60, 20 / 60])
    assert unit_duty(np.ones((10, 1)), 1.0) == pytest.approx([10 / 60]), "silence follows"
    assert unit_duty(np.ones((10, 1)), 1.0, repeats=3) == pytest.approx([30 / 60])
    assert unit_duty(np.ones((10, 1)), 1.0, repeats=10**6) == pytest.approx([1.0])
    assert unit_duty(np.tile([[1.0], [0.0]], (50, 1)), 1.0, repeats=7) == pytest.approx([0.5])


def test_repeats_follow_each_other_without_silence():
    """A drive that does not fill its last part is not longer for it; the judge repeats frames one by one."""
    rng, rate = np.random.default_rng(3), 20.0
    for frames, repeats in ((1, 1200), (1, 2000), (7, 400), (33, 50), (1250, 2), (1250, 3)):
        level = rng.random((frames, ARRAY.count))
        drive = Drive(phase=np.zeros(level.shape), level=level, rate=rate, array=ARRAY)
        parts = unit_levels(drive, every=2)
        found = unit_duty(parts, rate / 2, duration=frames / rate, repeats=repeats)
        each = np.tile(unit_levels(drive), (repeats, 1))
        sums = np.concatenate([np.zeros((1, 4)), np.cumsum(each, axis=0)])
        width = min(1200, len(each))
        expected = (sums[width:] - sums[:-width]).max(axis=0) / 1200
        # Parts of two frames may begin a minute between two frames.
        np.testing.assert_allclose(found, expected, atol=1 / 1200 if frames > 1 else 1e-12)


def test_levels_of_units_are_means_of_their_own_transducers():
    level = np.zeros((3, ARRAY.count))
    level[1, ARRAY.unit == 2] = 0.8
    drive = Drive(phase=np.zeros(level.shape), level=level, rate=1.0, array=ARRAY)
    np.testing.assert_allclose(unit_levels(drive), [[0, 0, 0, 0], [0, 0, 0.8, 0], [0, 0, 0, 0]])
    common = Drive(phase=np.zeros(level.shape), level=np.array([0.1, 0.2, 0.3]), rate=1.0, array=ARRAY)
    np.testing.assert_allclose(unit_levels(common), np.repeat([[0.1], [0.2], [0.3]], 4, axis=1))


def test_constant_and_rising_heat_follow_the_closed_form_of_a_thick_body():
    """A constant flow warms with the square root of time; one that rises by a t with a k (2/3) t^1.5."""
    step, count = 0.01, 1000
    time = (np.arange(count) + 1) * step
    constant = skin_warming(np.full(count, STRONG_FOCUS), step)
    np.testing.assert_allclose(constant, PUBLISHED_RISE * np.sqrt(time / 5.0), rtol=1e-9)
    rising = skin_warming(STRONG_FOCUS * (time - step / 2), step)
    np.testing.assert_allclose(rising[100:], (PUBLISHED_RISE / np.sqrt(5.0) * 2 / 3 * time**1.5)[100:], rtol=2e-3)


def test_a_still_focus_warms_as_published_and_a_weaker_one_by_the_square_of_its_level():
    found = palm_warming(still(5.0), PALM, acoustics=Acoustics())
    amplitude = np.abs(transfer_matrix(PALM, ARRAY)).sum()
    medium = Acoustics().medium
    share = amplitude**2 / (2 * medium.density * medium.speed) / STRONG_FOCUS
    assert found == pytest.approx(PUBLISHED_RISE * share, rel=1e-4)
    assert share == pytest.approx(1.0, rel=0.1), "the assumed strong focus is that of four units"
    assert palm_warming(still(5.0, level=0.5), PALM, acoustics=Acoustics()) == pytest.approx(found / 4, rel=1e-4)
    assert palm_warming(still(1.0), PALM, acoustics=Acoustics(), repeats=5) == pytest.approx(found, rel=1e-4)
    minute = palm_warming(still(60.0), PALM, acoustics=Acoustics())
    assert minute == pytest.approx(found * np.sqrt(12), rel=1e-4)
    assert palm_warming(still(70.0), PALM, acoustics=Acoustics()) == pytest.approx(minute, rel=1e-4)


@pytest.mark.parametrize(("period", "few"), [(2, 5000), (7, 5000), (7, 1500), (8, 1500), (20, 1500)])
def test_a_modulated_focus_warms_as_its_mean_intensity_whatever_its_period(period, few, monkeypatch):
    """All frames, or some of a long drive."""
    monkeypatch.setattr("midair.physics.exposure_places._FRAMES", few)
    drive = still(5.0, rate=1000.0)
    level = (np.arange(drive.frames) % period < period / 2).astype(float)
    modulated = Drive(phase=drive.phase, level=level, rate=1000.0, array=ARRAY)
    mean = level.mean() * palm_warming(still(5.0), PALM, acoustics=Acoustics())
    assert palm_warming(modulated, PALM, acoustics=Acoustics()) == pytest.approx(mean, rel=0.01 if few == 5000 else 0.1)
