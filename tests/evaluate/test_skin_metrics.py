import dataclasses
import json
import math

import numpy as np
import pytest

from midair.errors import MismatchError, RateError, ShapeError
from midair.evaluate import advance, perceptual_metrics
from midair.model import PressureFrames, SensorGrid


def frames(signal=None, channel=5, rate=1000.0):
    time = np.arange(512) / rate
    pressure = np.zeros((512, 16))
    pressure[:, channel] = 10 * np.sin(2 * np.pi * 125 * time) * np.hanning(512) if signal is None else signal
    return PressureFrames(pressure=pressure.reshape(-1, 4, 4), rate=rate)


def scaled(original, factor):
    return dataclasses.replace(original, pressure=factor * original.pressure)


def test_the_same_is_the_same():
    card = perceptual_metrics(frames(), frames())
    assert card.figure("ST-SIM").overall == pytest.approx(1)
    assert card.figure("SPQI").overall == pytest.approx(1)
    assert card.figure("Pacinian power difference").overall == pytest.approx(0)
    assert card.figure("stray power").overall == -math.inf
    assert card.compared.sum() == 1
    assert card.compared[1, 1]
    assert np.isnan(card.figure("ST-SIM").channels[0, 0])


def test_half_as_strong_is_6_db_and_nearly_4_steps_weaker():
    card = perceptual_metrics(frames(), scaled(frames(), 0.5))
    assert card.figure("Pacinian power difference").overall == pytest.approx(20 * np.log10(0.5), abs=1e-6)
    steps = card.figure("the same in just noticeable differences")
    assert steps.overall == pytest.approx(-3.81, abs=0.01)
    # To rounding, because the total level is computed from the powers.
    assert steps.overall == pytest.approx(steps.channels[1, 1], rel=1e-12)
    assert card.figure("ST-SIM").overall < 1


def test_the_level_over_the_threshold_by_hand():
    """10 Pa move skin by 1.68 um, 24.5 dB over .1 um; at 125 Hz the threshold is 12 dB higher; Hann: -4.26 dB."""
    level = perceptual_metrics(frames(), frames()).figure("Pacinian power, original").overall
    assert level == pytest.approx(20 * np.log10(16.8) - 12 + 10 * np.log10(0.375), abs=0.2)


def test_a_delay_is_not_felt():
    late = dataclasses.replace(frames(), pressure=advance(frames().pressure, -0.012, 1000.0))
    assert perceptual_metrics(frames(), late).figure("ST-SIM").overall == pytest.approx(1, abs=1e-3)


def test_elsewhere_is_stray():
    card = perceptual_metrics(frames(channel=5), frames(channel=6))
    assert card.figure("stray power").overall == pytest.approx(0, abs=1e-6)
    assert card.figure("stray power").channels[1, 2] == pytest.approx(0, abs=1e-6)


def test_silence_gives_no_nan_overall():
    silent = scaled(frames(), 0.0)
    for pair in ((frames(), silent), (silent, frames()), (silent, silent)):
        assert not any(np.isnan(each.overall) for each in perceptual_metrics(*pair).figures)


def test_every_figure_has_an_explanation_and_none_is_a_total():
    card = perceptual_metrics(frames(), scaled(frames(), 0.9))
    assert all(each.meaning.endswith(".") and len(each.meaning) > 40 for each in card.figures)
    assert not {"score", "total", "quality"} & {each.name.lower() for each in card.figures}
    plain = card.plain()
    assert len(plain["figures"]) == len(card.figures)
    assert json.dumps(plain)


def test_mismatched_recordings_are_rejected():
    with pytest.raises(RateError):
        perceptual_metrics(frames(), frames(rate=500.0))
    with pytest.raises(MismatchError):
        perceptual_metrics(
            frames(), PressureFrames(pressure=np.ones((512, 2, 2)), rate=1000.0, sensor=SensorGrid(rows=2, columns=2))
        )
    short = PressureFrames(pressure=np.ones((20, 4, 4)) * np.arange(20)[:, None, None], rate=1000.0)
    with pytest.raises(ShapeError, match="64 ms"):
        perceptual_metrics(short, short)


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1.0, "A palm would feel it, as strong as the original and with much the same spectrum"),
        (4.0, "A palm would feel it, 4 times as strong as the original and with much the same spectrum"),
        (0.3, "A palm would feel it, 0.3 times as strong as the original and with much the same spectrum"),
        (0.8, "A palm would feel it, 20 % weaker than the original and with much the same spectrum"),
        (1e-4, "A palm would not feel it"),
    ],
)
def test_a_verdict_in_one_sentence(factor, said):
    time = np.arange(400) / 1000
    wave = 20 * np.sin(2 * np.pi * 200 * time)[:, None, None] * np.ones((1, 4, 4))
    original = PressureFrames(pressure=wave, rate=1000.0)
    verdict = perceptual_metrics(original, PressureFrames(pressure=factor * wave, rate=1000.0)).verdict()
    assert verdict.startswith(said)
    assert "not tried on people" in verdict


@pytest.mark.long
def test_a_weaker_copy_has_the_same_spectrum():
    rng = np.random.default_rng(6)
    original = PressureFrames(pressure=5 * rng.standard_normal((2000, 4, 4)), rate=1000.0)
    card = perceptual_metrics(original, scaled(original, 0.8))
    assert card.figure("SPQI, level matched").overall == pytest.approx(1)
    assert card.figure("ST-SIM, level matched").overall == pytest.approx(1)
    assert card.figure("SPQI").overall < 0.5
    assert len(card.rows()) < len(card.figures)


def test_the_verdict_states_each_band_and_the_range_over_people():
    said = perceptual_metrics(frames(), frames()).verdict()
    # 10 Pa at 125 Hz as a Hann burst on 1.21 cm2: 24.5 - 12 - 4.3 - 3.8 dB.
    assert "20 to 40 Hz far below, 40 to 150 Hz 4 dB above, 150 to 470 Hz far below the detection threshold" in said
    assert "that of people lies -20 to +13 dB from it" in said
