from dataclasses import replace

import numpy as np
import pytest

from midair.model import Calibration, Provenance, Recording, SensorGrid
from midair.recordings import unreproduced

TIME = np.arange(4000) / 1000


def recording(signal, **more):
    return Recording(samples=np.repeat(signal, 16).reshape(-1, 4, 4), rate=1000.0, unit="Pa", **more)


def test_a_steady_press_is_below_the_band():
    told = unreproduced(recording(12 + 3 * np.sin(2 * np.pi * 100 * TIME)), None, (20.0, 470.0))
    assert told["below_pa"] == pytest.approx(12, rel=1e-3)
    assert told["below_share"] == pytest.approx(144 / 148.5, rel=1e-3)
    assert told["text"].startswith("97 % of the power (12 Pa rms) below 20 Hz: a wider --band")


def test_slow_and_fast_waves_are_told_apart():
    signal = np.sin(2 * np.pi * 5 * TIME) + np.sin(2 * np.pi * 50 * TIME) + np.sin(2 * np.pi * 400 * TIME)
    told = unreproduced(recording(signal), None, (20.0, 300.0))
    assert [told["below_share"], told["above_share"]] == pytest.approx([1 / 3, 1 / 3], rel=1e-2)
    assert unreproduced(recording(np.sin(2 * np.pi * 50 * TIME)), None, (20.0, 470.0))["text"] == ""


def test_a_dead_cell_is_worth_its_neighbours_unless_it_was_never_touched():
    samples = np.repeat(np.sin(2 * np.pi * 50 * TIME), 4).reshape(-1, 2, 2).copy()
    samples[:, 0, 1] = 0
    grid = SensorGrid(rows=2, columns=2)
    dead = Recording(samples=samples, rate=1000.0, unit="Pa", sensor=grid)
    told = unreproduced(dead, None, (20.0, 470.0))
    assert told["dead_cells"] == (1,)
    assert told["dead_share"] == pytest.approx(0.25, rel=1e-3)
    assert "cells (1,) that recorded nothing" in told["text"]
    drawn = Recording(
        samples=samples, rate=1000.0, unit="Pa", sensor=grid, provenance=Provenance().then("footprint", {})
    )
    assert unreproduced(drawn, None, (20.0, 470.0))["text"] == ""


def test_what_the_sensor_cannot_measure_is_left_out():
    """A response of a hundredth below 20 Hz: noise there would become tens of pascals."""
    response = np.where(np.arange(501) < 20, 0.01, 1.0)[:, None, None] * np.ones((1, 4, 4))
    known = Calibration(
        sensor=SensorGrid(), frequency=np.arange(501.0), response=response.astype(complex), noise=np.zeros((4, 4))
    )
    volts = Recording(samples=recording(0.1 + np.sin(2 * np.pi * 100 * TIME)).samples, rate=1000.0, sensor=SensorGrid())
    assert unreproduced(volts, known, (20.0, 470.0))["below_pa"] == pytest.approx(0, abs=1e-6)
    later = replace(known, frequency=known.frequency[20:], response=np.ones((481, 4, 4), complex))
    assert unreproduced(volts, later, (20.0, 470.0))["below_pa"] == pytest.approx(0, abs=1e-6)
