from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from midair.datasets import sample
from midair.model import AmplitudeFrames, Calibration, ControlGrid, Medium, Provenance, TransducerArray
from midair.physics import PlaybackChain, Transducers, radiation_pressure, simulate, sound_amplitude, transfer_matrix
from midair.pipeline import calibrated_pressure, reproduce
from midair.pressure_level import level_of, thinned
from midair.settings import finest_mode
from midair.solvers import solve

SMALL = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=6, columns=6, pitch=11e-3)


def test_a_fine_grid_costs_no_more_than_the_paper_s():
    fine = ControlGrid(rows=40, columns=31, pitch=55e-3 / 40, centre=(3e-3, 0.0))
    chosen = fine.position[thinned(fine)]
    assert len(chosen) == 14 * 11
    np.testing.assert_allclose(np.unique(np.diff(np.unique(chosen[:, 0]))), 3 * fine.pitch)
    assert len(thinned(GRID)) == GRID.count


@cache
def level(asked, lead=0):
    """A wave between 0 and `asked` Pa on the whole grid, between two parts of silence."""
    time = np.arange(100) / 1000
    wave = asked / 2 * (1 - np.cos(2 * np.pi * 100 * time))
    pressure = np.concatenate([np.zeros(lead), wave, np.zeros(lead)])[:, None] * np.ones(GRID.count)
    life = Provenance().then("lead", {"lead_s": lead / 1000}) if lead else Provenance()
    target = AmplitudeFrames(amplitude=sound_amplitude(pressure, Medium()), rate=1000.0, grid=GRID, provenance=life)
    return level_of(solve(target, SMALL, method="fast", iterations=20), target)


def test_a_wave_of_4_pa_is_reproduced_by_one_unit():
    told = level(4.0)
    assert told.asked == pytest.approx(4)
    assert told.steady == pytest.approx(2, rel=0.01)
    assert told.vibration == pytest.approx(2 / np.sqrt(2), rel=0.05)
    assert told.comes == pytest.approx(1, abs=0.03)
    loudest = np.abs(transfer_matrix(GRID, SMALL)).sum(axis=1).max()
    assert told.strength == pytest.approx(np.sqrt(4 / radiation_pressure(np.array(loudest), Medium())))
    assert (told.too_loud, told.advice()) == (False, "")
    assert dict(told.rows())["pressure"].startswith("peak 4 Pa: 2 Pa steady push")
    # The lead does not count.
    led = level(4.0, lead=60)
    assert (led.steady, led.vibration) == pytest.approx((told.steady, told.vibration))


def top_on_palm(drive, height, pitch):
    """Highest pressure of simulated playback on a palm of 85 mm, with transducers that follow slowly."""
    x, y = np.meshgrid(*2 * [np.arange(-42.5e-3, 42.6e-3, pitch)])
    palm = np.stack([x, y, np.full_like(x, height)], axis=-1)[np.hypot(x, y) <= 42.5e-3]
    G = transfer_matrix(palm, drive.array, acoustics=drive.acoustics)
    chain = PlaybackChain(transducers=Transducers.alike(drive.array.count))
    return simulate(drive, G, chain=chain, rate=drive.rate).max()


@pytest.mark.long
def test_the_peak_is_that_of_the_loudest_point_of_the_palm():
    """It is not at a control point, and not in one of the 100 frames with the most power."""
    array, grid = TransducerArray.autd3(columns=2, rows=1), ControlGrid(rows=6, columns=6, pitch=11e-3)
    for focus in ((0.0, 0.0), (7.3e-3, -2.1e-3)):
        at = np.hypot(*(grid.position[:, :2] - focus).T)
        sharp, broad = 900.0 * np.exp(-((at / 9e-3) ** 2)), np.full(36, 400.0)
        wanted = AmplitudeFrames(amplitude=[sharp] * 20 + [broad] * 100, rate=1000.0, grid=grid)
        made = solve(wanted, array, method="fast")
        top = top_on_palm(made.drive, grid.height, pitch=1e-3)
        assert level_of(made, wanted).peak == pytest.approx(top, rel=0.05), focus
        assert top > 1.1 * radiation_pressure(made.drive.q @ transfer_matrix(grid, array).T, Medium()).max(), focus


@pytest.mark.long
def test_the_peak_of_a_recording_in_the_finest_mode():
    settings, array = finest_mode().but(strength=0.15), TransducerArray.autd3(columns=2, rows=1)
    denim = replace(sample("denim"), rate=500.0)
    flat = Calibration.flat(denim.sensor, sensitivity=1.0, unit=denim.unit)
    made = reproduce(calibrated_pressure(denim, flat, settings.but(band=(20.0, 200.0))).cut(0.4, 0.05), array, settings)
    top = top_on_palm(made.solution.drive, settings.target.grid.height, pitch=1e-3)
    assert level_of(made.solution, made.target).peak == pytest.approx(top, rel=0.05)


def test_above_the_linear_range_it_gives_advice():
    told = level(100.0)
    assert told.too_loud
    assert told.comes < 0.6
    assert f"--strength {told.strength * np.sqrt(told.comes):.2g}" in told.advice()
    again = level(told.comes * told.asked)
    assert again.comes > 0.85
