import numpy as np
import pytest

from midair.model import BAND, PressureFrames, SensorGrid
from midair.settings import Settings
from midair.targets import Circle, add_lead, default_lead, receptor_levels, receptors

RATE = 1000.0
TIME = np.arange(4000) / RATE


def lines(mapped):
    """Amplitudes at whole Hz in the middle two seconds."""
    spectrum = np.abs(np.fft.rfft(mapped[1000:3000], axis=0, norm="forward"))[::2]
    return np.concatenate([spectrum[:1], 2 * spectrum[1:]])


def test_three_bands_become_a_mean_and_two_lines():
    """3 Pa at 25 Hz and 2 Pa at 210 Hz: P = max(mean, 3 + 2) + 3 cos(2 pi 30 t) + 2 cos(2 pi 150 t)."""
    for mean, kept in ((20.0, 20.0), (3.0, 5.0), (0.0, 5.0), (-9.0, 5.0)):
        pressure = mean + 3 * np.sin(2 * np.pi * 25 * TIME) + 2 * np.sin(2 * np.pi * 210 * TIME)
        mapped = receptors(pressure[:, None, None], RATE)
        assert mapped.min() >= 0, mean
        found = lines(mapped[:, 0, 0])
        assert found[[0, 30, 150]] == pytest.approx([kept, 3, 2], rel=2e-3), mean
        assert np.delete(found, [0, 30, 150]).max() < 0.01, mean


def test_a_slow_press_is_kept_and_bands_are_shared_at_their_limits():
    slow, fast, pacinian = receptor_levels(10 + np.cos(2 * np.pi * 2 * TIME)[:, None], RATE)
    assert slow[1000:3000, 0] == pytest.approx(10 + np.cos(2 * np.pi * 2 * TIME[1000:3000]), abs=1e-3)
    assert max(fast[1000:3000].max(), pacinian[1000:3000].max()) < 1e-3
    at_the_limit = receptor_levels(np.sin(2 * np.pi * 60 * TIME)[:, None], RATE)
    assert [float(each[1000:3000].mean()) for each in at_the_limit] == pytest.approx([0, 0.5, 0.5], abs=2e-3)


def test_its_lead_begins_in_silence():
    noise = np.random.default_rng(1).normal(size=(700, 1, 1))
    touch = PressureFrames(pressure=noise, rate=RATE, sensor=SensorGrid(rows=1, columns=1), band=BAND)
    led = receptors(add_lead(touch, default_lead("receptors", BAND)).pressure, RATE)
    assert max(led[0].max(), led[-1].max()) < 5e-3 * led.max()


def test_the_option_turns_the_pattern_on_an_orbit():
    chosen = Settings().but(mapping="receptors")
    assert (chosen.target.mapping, chosen.target.circle) == ("receptors", Circle())
    assert chosen.but(circle=0).target.circle is None
    own = Circle(radius=5e-3)
    assert Settings().but(circle=own).but(mapping="receptors").target.circle is own
