from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from midair.model import Calibration, Provenance, Recording, SensorGrid
from midair.physics import SensorModel, channel_response, sense
from midair.recordings import at_limit, dead_channels, suspicious, unreproduced


def recording(samples):
    return Recording(samples=samples, rate=1000.0)


def test_a_constant_channel_is_dead():
    samples = np.random.default_rng(0).standard_normal((50, 4, 4))
    samples[:, 1, 2] = 3.0
    samples[:, 3, 0] = 0.0
    assert np.argwhere(dead_channels(recording(samples))).tolist() == [[1, 2], [3, 0]]


def test_the_virtual_sensor_clips_at_its_limit():
    time = np.arange(1000) / 1000
    pressure = np.zeros((1000, 4, 4))
    pressure[:, 0, 0] = 400 * np.sin(2 * np.pi * 53.7 * time)  # 8 V where 5 fit
    pressure[:, 0, 1] = 100 * np.sin(2 * np.pi * 53.7 * time)
    volts = sense(SensorModel(), pressure, 1000.0, rng=np.random.default_rng(0))
    swing = 400 * np.abs(channel_response(SensorModel(), np.array([53.7]))[0, 0, 0])
    shares = at_limit(volts, 5.0).mean(axis=0)
    assert shares[0, 0] == pytest.approx(2 / np.pi * np.arccos(5 / swing), abs=0.01)
    assert (shares.ravel()[1:] == 0).all()


@pytest.fixture
def samples():
    """Sines, slow against the rate, on 16 channels."""
    time = np.arange(2000) / 1000
    return np.stack([np.sin(2 * np.pi * 20 * time + i) for i in range(16)], axis=1)


def report(samples, **life):
    return suspicious(Recording(samples=samples.reshape(-1, 4, 4), rate=1000, unit="count", **life))


def test_names_what_never_changes_and_a_white_floor_and_nothing_else(samples):
    rng, good = np.random.default_rng(0), samples.copy()
    assert report(good) == ()
    samples[:, 5] *= 1e-3
    assert report(samples) == (), "a quiet signal is no noise floor"
    assert report(rng.normal(size=samples.shape)) == (), "white signals are allowed: a sponge may sound like one"
    samples[:, 5] = 1e-3 * rng.normal(size=2000)
    assert report(samples) == ("Channels that hold only white noise, more than ten times below the others: 5.",)
    samples[:, 9] = 0
    for life in (Provenance(simulated=True), Provenance().then("footprint", {})):
        assert report(samples**4, provenance=life) == ("2 of 16 cells are untouched.",), "nor rectified"
    good[:, 3], good[:, 9] = 0, 65535
    assert report(good) == (
        "Channels that never change: 3 (0 count), 9 (65535 count); they are dead, saturated or not touched.",
    )
    assert [len(report(good * scale)) for scale in (1e-300, 1e300)] == [1, 1]


CLIPPED = "Channels that reach their maximum or minimum repeatedly, clipped: 5."


def test_names_a_clipped_channel(samples):
    """A tone of 50 or 100 Hz has 20 levels at most, and stands at its greatest three frames in a row."""
    limits = [(83.7, -0.9, 0.9), (83.7, -1, 0.9), (83.7, -0.9, 1), (50, -0.7, 0.7), (100, -0.7, 0.7)]
    for steps, (frequency, low, high) in product([None, 32767, 2047], limits):
        clipped = np.clip(np.sin(2 * np.pi * frequency * np.arange(2000) / 1000 + 0.3), low, high)
        samples[:, 5] = clipped if steps is None else np.round(steps * clipped)
        assert report(samples) == (CLIPPED,), (steps, frequency, low, high)


def test_coarse_slow_and_even_tones_and_held_values_do_not_clip(samples):
    waves = [np.sin(2 * np.pi * frequency * np.arange(2000) / 1000) for frequency in (0.3, 3, 83.7, 100, 250)]
    waves += [np.repeat(np.tile(levels, 2000), 10)[:2000] for levels in ([0, 0.3, 1.0], [-1, -0.2, 0.1, 1])]
    for steps, (number, wave) in product([20, 60, 500, 32767], enumerate(waves)):
        samples[:] = np.round(steps * wave)[:, None]
        assert not any("clipped" in sentence for sentence in report(samples)), (steps, number)


def test_names_a_magnitude_and_no_offset_and_an_outlier_in_a_short_recording():
    noise = np.random.default_rng(0).normal(size=(2, 2000, 16))
    assert "magnitude" in report(np.hypot(*noise))[0]
    assert report(noise[0]) == report(noise[0] + 5) == ()
    short = 0.1 * np.random.default_rng(0).normal(size=(60, 4, 4))
    assert report(short.reshape(60, 16)) == ()
    short[17, 0, 0] = 1e20
    assert "channel 0 (1e+20 count in frame 17)" in report(short.reshape(60, 16))[0]


def test_names_outliers_and_no_taps(samples):
    samples[700, 3], samples[[20, 21], 9] = 1e19, -9e3
    samples[:, 4] = 0
    samples[100, 4] = 1  # an impulse, as a program computes it
    samples[500:540, 5] += 1e4 * np.exp(-np.arange(40) / 5)  # a tap
    frames = samples.reshape(-1, 4, 4)
    assert [line for line in suspicious(Recording(samples=frames, rate=1000, unit="V")) if "Outliers" in line] == [
        "Outliers, more than a thousand times as far from the median as the other values: channel 3 (1e+19 V in frame"
        " 700), 9 (-9000 V in frame 20); check them, since a wrong bit or a lost cable looks the same."
    ]


TIME = np.arange(4000) / 1000


def lowest(signal, **more):
    return Recording(samples=np.repeat(signal, 16).reshape(-1, 4, 4), rate=1000.0, unit="Pa", **more)


def test_a_steady_press_is_below_the_band_in_the_frames_that_are_named_and_fast_waves_above():
    told = unreproduced(lowest(12 + 3 * np.sin(2 * np.pi * 100 * TIME)), None, (20.0, 470.0))
    assert told["below_pa"] == pytest.approx(12, rel=1e-3)
    assert told["below_share"] == pytest.approx(144 / 148.5, rel=1e-3)
    assert told["text"].startswith("the slow press below 20 Hz, 97 % of the power; keep it: ")
    press, parts = np.where(TIME < 2, 12, 0) + 3 * np.sin(2 * np.pi * 100 * TIME), (slice(2000), slice(2000, None))
    shares = [unreproduced(lowest(press), None, (20.0, 470.0), part)["below_share"] for part in parts]
    assert shares == pytest.approx([144 / 148.5, 0], abs=1e-3)
    signal = np.sin(2 * np.pi * 5 * TIME) + np.sin(2 * np.pi * 50 * TIME) + np.sin(2 * np.pi * 400 * TIME)
    told = unreproduced(lowest(signal), None, (20.0, 300.0))
    assert [told["below_share"], told["above_share"]] == pytest.approx([1 / 3, 1 / 3], rel=1e-2)
    assert unreproduced(lowest(np.sin(2 * np.pi * 50 * TIME)), None, (20.0, 470.0))["text"] == ""


def test_a_dead_cell_is_worth_its_neighbours_unless_it_was_never_touched():
    samples = np.repeat(np.sin(2 * np.pi * 50 * TIME), 4).reshape(-1, 2, 2).copy()
    samples[:, 0, 1] = 0
    grid = SensorGrid(rows=2, columns=2)
    dead = Recording(samples=samples, rate=1000.0, unit="Pa", sensor=grid)
    told = unreproduced(dead, None, (20.0, 470.0))
    assert told["dead_cells"] == (1,)
    assert told["dead_share"] == pytest.approx(0.25, rel=1e-3)
    assert "cells (1,) recorded nothing" in told["text"]
    drawn = replace(dead, provenance=Provenance().then("footprint", {}))
    assert unreproduced(drawn, None, (20.0, 470.0))["text"] == ""


def test_what_the_sensor_cannot_measure_is_left_out():
    """A response of a hundredth below 20 Hz: noise there would become tens of pascals."""
    response = np.where(np.arange(501) < 20, 0.01, 1.0)[:, None, None] * np.ones((1, 4, 4))
    known = Calibration(
        sensor=SensorGrid(), frequency=np.arange(501.0), response=response.astype(complex), noise=np.zeros((4, 4))
    )
    volts = Recording(samples=lowest(0.1 + np.sin(2 * np.pi * 100 * TIME)).samples, rate=1000.0, sensor=SensorGrid())
    assert unreproduced(volts, known, (20.0, 470.0))["below_pa"] == pytest.approx(0, abs=1e-6)
    later = replace(known, frequency=known.frequency[20:], response=np.ones((481, 4, 4), complex))
    assert unreproduced(volts, later, (20.0, 470.0))["below_pa"] == pytest.approx(0, abs=1e-6)
