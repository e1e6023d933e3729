import numpy as np
import pytest

from midair.dsp import band_energy
from midair.model import PressureFrames
from midair.targets import add_lead, default_lead, mapping_of, remove_lead

RATE = 1000.0


def piece(band=(20.0, 470.0), frames=300):
    """A recording cut within a touch: it begins and ends far from zero."""
    time = np.arange(frames) / RATE
    wave = np.cos(2 * np.pi * 1.25 * band[0] * time) - 0.4
    return PressureFrames(pressure=8 * wave[:, None, None] * np.ones((1, 4, 4)), rate=RATE, band=band)


def test_it_swells_from_silence_and_keeps_the_middle_longer_for_a_slow_bias():
    longer = add_lead(piece(), 0.15)
    assert longer.frames == 600
    np.testing.assert_array_equal(longer.pressure[150:-150], piece().pressure)
    assert np.abs(longer.pressure[:91]).max() == 0
    assert np.abs(longer.pressure[-90:]).max() == 0
    np.testing.assert_allclose(longer.pressure[149], piece().pressure[0], rtol=2e-3)
    assert longer.provenance.steps[-1].settings == {"lead_s": 0.15}
    np.testing.assert_array_equal(remove_lead(longer, 300).pressure, piece().pressure)
    assert add_lead(piece(), 0.0).frames == 300
    leads = {("half-wave", 20.0): 0.06, ("slow-bias", 20.0): 0.15, ("slow-bias", 1.0): 3.0, ("slow-bias", 0.0): 3.0}
    assert {(name, low): default_lead(name, (low, 470.0)) for name, low in leads} == pytest.approx(leads)


def test_the_bias_starts_at_zero_and_changes_slowly():
    """Without a lead, a recording cut within a touch begins with a static step of the bias."""
    for band in ((20.0, 470.0), (5.0, 400.0)):
        x = piece(band, frames=round(6000 / band[0]))
        to_push = mapping_of("slow-bias", band)
        assert (to_push(x.pressure, RATE) - x.pressure)[0].max() > 5, band
        longer = add_lead(x, default_lead("slow-bias", band)).pressure
        pushed = to_push(longer, RATE)
        assert pushed[0].max() < 0.01, band
        inside, wanted = (
            float(band_energy(y[:, 0, 0], RATE, (band[0], 470.0), resolution=band[0] / 10))
            for y in (pushed - longer, longer)
        )
        assert inside < 1e-3 * wanted, band
