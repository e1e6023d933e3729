from dataclasses import replace

import numpy as np
import pytest

from midair.evaluate import TOUCHED, advance, compare, fidelity, in_band, ratio_text
from midair.evaluate.distortion import decibels, distortion_ratios, image_level, map_correlation
from midair.model import PressureFrames

RATE = 4000.0
TIME = np.arange(4000) / RATE


def frames(signals, rate=RATE):
    """Signals on some channels, {channel: samples}; the others are silent."""
    count = len(next(iter(signals.values())))
    pressure = np.zeros((count, 16))
    for channel, signal in signals.items():
        pressure[:, channel] = signal
    return PressureFrames(pressure=pressure.reshape(-1, 4, 4), rate=rate)


def sine(frequency, amplitude=1.0):
    return amplitude * np.sin(2 * np.pi * frequency * TIME) * np.hanning(len(TIME))


def test_distortion_by_hand():
    """A second sine of a tenth is 20 dB of distortion; steady pressure and one outside the band do not count."""
    x = frames({5: sine(100)})
    y = frames({5: 0.7 * (sine(100) + sine(200, 0.1)) + 3.0 + sine(600, 0.5)})
    found = fidelity(x, y)
    assert found.distortion_ratio == pytest.approx(20, abs=0.05)
    assert found.overall_ratio == pytest.approx(20, abs=0.05)
    assert found.gain == pytest.approx(0.7, abs=1e-3)
    assert found.spatial_correlation == pytest.approx(1)


def test_another_gain_on_each_cell_and_pressure_beside_the_target_are_distortion_overall_alone():
    found = fidelity(frames({0: sine(100), 15: sine(150)}), frames({0: sine(100), 15: sine(150, 0.5)}))
    assert found.distortion_ratio > 60
    # gains 1 and .5: the best common gain is .75, with an error of .25 on both
    assert found.overall_ratio == pytest.approx(20 * np.log10(3), abs=0.05)
    found = fidelity(frames({5: sine(100)}), frames({5: sine(100), 6: sine(100, 0.1)}))
    assert found.distortion_ratio > 60
    assert found.overall_ratio == pytest.approx(20, abs=0.05)
    assert found.spatial_correlation < 1


def noisy_piece(late):
    """One second of noise in the band on every cell, and the same with a fractional delay."""
    rng = np.random.default_rng(0)
    x = frames(dict(enumerate(in_band(rng.normal(size=(4000, 16)), RATE, (20.0, 470.0)).T)))
    return x, replace(x, pressure=advance(x.pressure, -late, RATE))


def test_a_perfect_piece_that_is_late_or_of_another_rate_is_perfect():
    """The error is that of the delay; a piece that is cut before alignment loses its ends."""
    x, late = noisy_piece(0.11e-3)
    found = fidelity(x, late, judged=(0.4, 0.12))
    assert found.delay == pytest.approx(0.11e-3, abs=2e-6)
    assert found.distortion_ratio > 50
    assert fidelity(x.cut(0.4, 0.12), late.cut(0.4, 0.12)).distortion_ratio < 40
    x = frames({5: sine(100)[::4]}, rate=1000.0)
    assert fidelity(x, frames({5: sine(100)})).distortion_ratio > 50


def test_only_the_evaluated_part_counts():
    """Except for the ringing of the sharp band edges."""
    x, late = noisy_piece(0.0)
    wrong = np.array(late.pressure)
    wrong[:800] *= -np.hanning(800)[:, None, None]
    spoilt = replace(late, pressure=wrong)
    assert fidelity(x, spoilt, judged=(0.8, 0.12)).distortion_ratio > 30
    assert fidelity(x, spoilt).distortion_ratio < 10


def test_images_of_steps_by_hand():
    held = frames({5: sine(100) + sine(800, 0.1)})
    assert image_level(held) == pytest.approx(-20, abs=0.1)
    assert image_level(frames({5: sine(100)[::4]}, rate=1000.0)) is None
    wave = np.sin(2 * np.pi * 400 * np.arange(8000) / 8000)
    levels = [image_level(frames({5: np.repeat(wave[::step], step)}, rate=8000.0)) for step in (8, 2)]
    # a hold of 1 / R turns f into R - f at sinc((R - f) / R) / sinc(f / R)
    assert levels[0] == pytest.approx(20 * np.log10(np.sinc(0.6) / np.sinc(0.4)), abs=0.3)
    assert levels[1] < -50


def test_maps_and_silence_give_numbers():
    one, other = (np.zeros((4, 4, 4)) for _ in range(2))
    one[:, 0, 0] = 1
    other[:, 3, 3] = 1
    assert map_correlation(one, 5 * one) == pytest.approx(1)
    assert map_correlation(one, other) == pytest.approx(-1 / 15)
    assert map_correlation(one, np.ones((4, 4, 4))) == 0
    silent = frames({5: 0 * TIME})
    for pair in ((silent, silent), (silent, frames({5: sine(100)})), (frames({5: sine(100)}), silent)):
        found = fidelity(*pair)
        assert not np.isnan([found.distortion_ratio, found.overall_ratio, found.gain, found.spatial_correlation]).any()
    assert decibels(0, 0) == -np.inf
    assert decibels(1, 0) == np.inf


def test_both_rulers_have_one_definition():
    """The figure of the documentation and that of `compare`, over the touched cells and over all."""
    rng = np.random.default_rng(3)
    x = in_band(rng.standard_normal((4000, 16)) * np.repeat([1.0, 0.3, 1e-3, 0.0], 4), RATE, (20.0, 470.0))
    y = x * np.linspace(0.5, 1, 16) + 0.05 * in_band(rng.standard_normal(x.shape), RATE, (20.0, 470.0))
    pair = [PressureFrames(pressure=each.reshape(-1, 4, 4), rate=RATE, band=(20.0, 470.0)) for each in (x, y)]
    one, other = fidelity(*pair), compare(*pair)
    for name in (TOUCHED, "signal to distortion"):
        assert one.ratios[name][0] == pytest.approx(other.ratios[name][0], abs=0.1)
    assert one.ratios[TOUCHED][0] == one.distortion_ratio > one.overall_ratio + 3
    assert other.ratios["signal to distortion"][0] == other.distortion_ratio
    assert set(other.ratios) == {TOUCHED, "signal to distortion"}


def test_without_noise_is_the_ratio_of_a_sensor_without_noise():
    """The limits hold the truth in 95 % of the draws: in 240 of 250 to 3 standard errors, 227 to 248."""
    rng, frames_, cells, level = np.random.default_rng(4), 600, 4, 0.1
    x = rng.standard_normal((frames_, cells))
    y = 0.8 * x + 0.08 * rng.standard_normal(x.shape)
    power, hits = (x**2).sum(axis=0), 0
    own = (x * y).sum(axis=0) / power
    truth = decibels((own**2 * power).sum(), ((y - own * x) ** 2).sum())
    for _ in range(250):
        noisy = y + level * rng.standard_normal(x.shape)
        own = (x * noisy).sum(axis=0) / power
        gain = (x * noisy).sum() / power.sum()
        apart, noise = ((noisy - own * x) ** 2).sum(axis=0), np.full(cells, level)
        found = distortion_ratios(power, own, gain, apart, noise=noise, frames=frames_, values=frames_)
        _, low, high = found[f"{TOUCHED}, without noise"]
        hits += low <= truth <= high
        assert found[TOUCHED][0] < low
    assert 227 <= hits <= 248


def test_noise_alone_gives_a_lower_limit():
    x = np.random.default_rng(5).standard_normal((2, 4000, 4))
    power, apart = (x[0] ** 2).sum(axis=0), 0.01 * (x[1] ** 2).sum(axis=0)
    found = distortion_ratios(power, np.ones(4), 1.0, apart, noise=np.full(4, 41.0**0.5), frames=1, values=4000)
    ratio, low, high = found["signal to distortion, without noise"]
    assert ratio == high == np.inf
    assert ratio_text((ratio, low, high)) == f"above {low:.1f}"
    assert ratio_text((20.0, 20.0, 20.0)) == "20.0"
    assert ratio_text((20.0, 19.5, np.inf)) == "20.0 (19.5 or more)"
