import dataclasses
import json

import numpy as np
import pytest

from midair.evaluate import advance, felt, in_band, perceptual_metrics
from midair.evaluate.verdict import OTHER
from midair.model import PressureFrames, SensorGrid


def frames(signal=None, channel=5, rate=1000.0):
    time = np.arange(512) / rate
    pressure = np.zeros((512, 16))
    pressure[:, channel] = 10 * np.sin(2 * np.pi * 125 * time) * np.hanning(512) if signal is None else signal
    return PressureFrames(pressure=pressure.reshape(-1, 4, 4), rate=rate)


def scaled(original, factor):
    return dataclasses.replace(original, pressure=factor * original.pressure)


def test_the_same_is_the_same_and_a_delay_is_not_felt():
    card = perceptual_metrics(frames(), frames())
    assert card.figure("ST-SIM").overall == pytest.approx(1)
    assert card.figure("SPQI").overall == pytest.approx(1)
    assert card.figure("Pacinian power difference").overall == pytest.approx(0)
    assert card.compared.sum() == 1
    assert card.compared[1, 1]
    assert np.isnan(card.figure("ST-SIM").channels[0, 0])
    late = dataclasses.replace(frames(), pressure=advance(frames().pressure, -0.012, 1000.0))
    assert perceptual_metrics(frames(), late).figure("ST-SIM").overall == pytest.approx(1, abs=1e-3)


def test_half_as_strong_is_6_db_weaker_and_alike():
    card = perceptual_metrics(frames(), scaled(frames(), 0.5))
    found = card.figure("Pacinian power difference")
    assert found.overall == pytest.approx(20 * np.log10(0.5), abs=1e-6)
    assert found.channels[1, 1] == pytest.approx(found.overall, rel=1e-12)
    assert card.felt.level == pytest.approx(card.figure("level over the threshold, original").overall - 6.02, abs=0.01)
    assert card.figure("other frequencies").overall < 1
    higher = frames(10 * np.sin(2 * np.pi * 175 * np.arange(512) / 1000))
    assert perceptual_metrics(frames(), higher).figure("other frequencies").overall > 2 * OTHER
    assert card.figure("ST-SIM").overall == pytest.approx(1)


def felt_as(wave):
    return felt(np.tile(wave[:, None, None], (1, 4, 4)), 1000.0, SensorGrid().pitch)


@pytest.mark.long
def test_noise_that_is_not_felt_is_no_other_spectrum():
    """Noise 24 dB below a tone, correlation .998; SPQI, which counts it, is .01 at 40 Hz."""
    rng, time = np.random.default_rng(0), np.arange(800) / 1000
    for frequency in (40, 60, 100, 250):
        tone = 10 * np.sin(2 * np.pi * frequency * time)
        noise = in_band(rng.normal(size=(800, 1, 1)), 1000.0, (20.0, 470.0))[:, 0, 0]
        noisy = tone + noise / noise.std() * tone.std() * 10 ** (-24 / 20)
        higher, two = (10 * np.sin(2 * np.pi * each * time) for each in (1.4 * frequency, 180))
        alone = felt_as(tone)
        share = [100 * felt_as(each).elsewhere(alone) for each in (noisy, 0.5 * tone, higher, tone + two)]
        assert share[0] < OTHER / 2, frequency
        assert share[1] < 1, frequency
        assert share[2] > 2 * OTHER, frequency
        assert share[3] > OTHER, frequency


def test_every_figure_has_an_explanation_and_none_is_nan_in_silence_or_a_total():
    card = perceptual_metrics(frames(), scaled(frames(), 0.9))
    assert [each.name for each in card.figures if len(each.meaning) <= 40] == []
    assert not {"score", "total", "quality"} & {each.name.lower() for each in card.figures}
    plain = card.plain()
    assert len(plain["figures"]) == len(card.figures)
    assert json.dumps(plain)
    silent = scaled(frames(), 0.0)
    for pair in ((frames(), silent), (silent, frames()), (silent, silent)):
        assert not any(np.isnan(each.overall) for each in perceptual_metrics(*pair).figures)
