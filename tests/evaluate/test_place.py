"""A shift and a turn of the pattern against readings of an independent, finely sampled sensor."""

import numpy as np
import pytest

import midair
from midair.evaluate import OVERALL, compare
from midair.evaluate.place import fit_place
from midair.model import PressureFrames, SensorGrid

SENSOR = SensorGrid()
RNG = np.random.default_rng(0)
WAVES = RNG.standard_normal((300, 5))
SPOTS = 1e-3 * RNG.uniform(-13, 13, (5, 2))


def rotation(angle):
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def read(aside=(0.0, 0.0), turn=0.0):
    """Mean over 8 mm of each cell of a sensor at a place, of five spots of 6 mm (sd) with a waveform each."""
    offset = 1e-3 * np.arange(-3.5, 4)
    x, y = np.meshgrid(SENSOR.x, SENSOR.y)
    middles = np.stack([x.ravel(), y.ravel()], axis=1)
    points = (middles[:, None, None] + np.stack(np.meshgrid(offset, offset), axis=-1)).reshape(-1, 2)
    points = points @ rotation(turn) + aside
    spots = np.exp(-((points[:, None] - SPOTS) ** 2).sum(axis=2) / (2 * 6e-3**2))
    cells = spots.reshape(16, -1, 5).mean(axis=1)
    return PressureFrames(pressure=(WAVES @ cells.T).reshape(-1, 4, 4), rate=1000.0)


def test_a_sensor_that_lies_aside_and_turned_finds_the_pattern(subtests):
    for aside, turn in (((11e-3, 0.0), 0.0), ((0.0, -4e-3), 0.0), ((2e-3, 2e-3), 6.0), ((-5e-3, 1e-3), -5.0)):
        with subtests.test(aside=aside, turn=turn):
            original, moved = read(), read(aside, np.radians(turn))
            free, fixed = compare(original, moved), midair.compare(original, moved, fixed_place=True)
            assert not fixed.place
            # The pattern lies on the other side, turned the other way; spots are rounder than the model's.
            assert np.degrees(free.place.turn) == pytest.approx(-turn, abs=3.2)
            away = -np.array(aside) @ rotation(-np.radians(turn))
            assert free.place.shift == pytest.approx(tuple(away), abs=0.7e-3)
            assert free.ratios[OVERALL][0] > fixed.ratios[OVERALL][0] + 7
            assert repr(free).endswith("people feel points under 15 mm apart as one>")


def test_noise_and_other_waves_do_not_lie_elsewhere(subtests):
    original = read().pressure
    for name, other in {
        "the same": original,
        "weaker with noise": 0.4 * original + 0.3 * RNG.standard_normal(original.shape),
        "another": RNG.standard_normal(original.shape),
        "half a wave": np.maximum(original, 0),
        "two cells aside": read((0.0, -20e-3)).pressure,
        "a quarter turn": read(turn=np.pi / 2).pressure,
        "silence": np.zeros_like(original),
    }.items():
        with subtests.test(name=name):
            place, moved = fit_place(original, other, SENSOR)
            assert (bool(place), moved is original) == (False, True)
