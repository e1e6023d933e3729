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


def test_it_swells_from_silence_and_keeps_the_middle():
    longer = add_lead(piece(), 0.15)
    assert longer.frames == 600
    np.testing.assert_array_equal(longer.pressure[150:-150], piece().pressure)
    assert np.abs(longer.pressure[:91]).max() == 0
    assert np.abs(longer.pressure[-90:]).max() == 0
    np.testing.assert_allclose(longer.pressure[149], piece().pressure[0], rtol=2e-3)
    assert longer.provenance.steps[-1].settings == {"lead_s": 0.15}
    np.testing.assert_array_equal(remove_lead(longer, 300).pressure, piece().pressure)
    assert add_lead(piece(), 0.0).frames == 300


@pytest.mark.parametrize("band", [(20.0, 470.0), (5.0, 400.0)])
def test_the_bias_starts_at_zero_and_changes_slowly(band):
    """Without a lead, a recording cut within a touch begins with a static step of the bias."""
    x = piece(band, frames=round(6000 / band[0]))
    to_push = mapping_of("slow-bias", band)
    bare = to_push(x.pressure, RATE) - x.pressure
    assert bare[0].max() > 5
    longer = add_lead(x, default_lead("slow-bias", band))
    pushed = to_push(longer.pressure, RATE)
    assert pushed[0].max() < 0.01
    added = (pushed - longer.pressure)[:, 0, 0]
    felt = (band[0], 470.0)
    inside, wanted = (
        float(band_energy(y, RATE, felt, resolution=band[0] / 10)) for y in (added, longer.pressure[:, 0, 0])
    )
    assert inside < 1e-3 * wanted


def test_a_slow_bias_needs_a_longer_lead():
    assert default_lead("half-wave", (20.0, 470.0)) == pytest.approx(0.06)
    assert default_lead("slow-bias", (20.0, 470.0)) == pytest.approx(0.15)
    assert default_lead("slow-bias", (1.0, 15.0)) == pytest.approx(3.0)
    assert default_lead("slow-bias", (0.0, 15.0)) == pytest.approx(3.0)
