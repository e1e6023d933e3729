import numpy as np
import pytest

from midair.calibration import scale_of_drop, scale_of_tone

RATE = 8000.0
TIME = np.arange(4000) / RATE


@pytest.mark.parametrize("hertz", [250.0, 1000.0, 997.3])
@pytest.mark.parametrize(("level", "peak"), [(94.0, np.sqrt(2) * 1.0024), (114.0, np.sqrt(2) * 10.024)])
def test_scale_of_a_tone_of_known_level(hertz, level, peak):
    """94 dB are 1.0024 Pa rms; the file has a 40th of the pressure, some noise and an offset."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(TIME))
    pressure = peak * np.sin(2 * np.pi * hertz * TIME + 0.3)
    found = scale_of_tone(pressure / 40 + noise + 0.2, RATE, level=level)
    assert found.scale == pytest.approx(40, rel=2e-3)
    assert f"A tone of {round(hertz / 2) * 2:g} Hz at {level:g} dB" in found.words


@pytest.mark.parametrize("sign", [1, -1])
def test_scale_of_a_falling_weight(sign):
    """A half sine of 4 ms whose integral is the momentum over the area, by hand: 2 g from 50 mm on 10 mm."""
    impulse = 2e-3 * np.sqrt(2 * 9.81 * 50e-3) / (np.pi * 25e-6)
    assert impulse == pytest.approx(25.2, rel=1e-2)
    blow = np.where(abs(TIME - 0.2) < 2e-3, np.cos((TIME - 0.2) * np.pi / 4e-3), 0.0)
    pressure = impulse / (4e-3 * 2 / np.pi) * blow
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(TIME))
    found = scale_of_drop(sign * pressure / 1e5 + noise, RATE, mass=2e-3, height=50e-3, diameter=10e-3)
    assert found.scale == pytest.approx(1e5, rel=0.01)
    assert "bounced" in found.words
