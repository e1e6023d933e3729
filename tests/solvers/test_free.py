"""Free amplitudes: less sound at quiet places and less power, at the error of equal amplitudes or below."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import Acoustics, AmplitudeFrames, ControlGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers import Free, solve

UNIT = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=6, columns=6, pitch=8e-3)
EARS = np.array([[-0.075, -0.35, 0.45], [0.075, -0.35, 0.45]])


def target(strength, frames=9):
    place = 18 + np.linspace(-6, 6, frames)[:, None]
    amplitude = np.exp(-(((np.arange(36) - place) / 6) ** 2))
    return AmplitudeFrames(amplitude=strength * focus_amplitude(GRID, UNIT) * amplitude, rate=1000.0, grid=GRID)


def sound(drive, points):
    return np.abs(drive.q @ transfer_matrix(points, UNIT, acoustics=Acoustics()).T)


@pytest.fixture(scope="module")
def solved():
    wanted = target(0.05)
    ways = {"fast": {"method": "fast"}, "free": {"method": "free"}, "ears": {"method": "free", "quiet_ears": 1.0}}
    return {name: solve(wanted, UNIT, **way) for name, way in ways.items()}


def test_a_fortieth_of_the_power_of_equal_amplitudes_and_quiet_ears_for_little_error(solved):
    power = {name: (np.abs(each.drive.q) ** 2).mean() for name, each in solved.items()}
    assert power["free"] < power["fast"] / 30
    assert solved["free"].error.max() < 0.025
    loud, quiet = (sound(solved[name].drive, EARS).max() for name in ("free", "ears"))
    assert quiet < loud / 15
    assert solved["ears"].error.max() < 0.05


@pytest.mark.long
def test_quiet_places_tolerate_what_the_power_stands_for():
    """With more power in the effort, random errors of the transducers cause less sound at the ears."""
    rng = np.random.default_rng(3)
    off = 0.3 * rng.standard_normal((40, 1, UNIT.count)) * np.exp(2j * np.pi * rng.random((40, 1, UNIT.count)))
    G = transfer_matrix(EARS, UNIT, acoustics=Acoustics())
    rms = []
    for power in (1e-6, 0.09):
        drive = solve(target(0.05, frames=1), UNIT, method=Free(power=power, effort=0.1), quiet_ears=1.0).drive
        rms.append(np.sqrt((np.abs((drive.q * (1 + off)) @ G.T) ** 2).mean()))
    assert rms[1] < rms[0]


def test_amplitudes_end_at_full_drive_with_a_moderate_error():
    made = solve(target(0.2), UNIT, method="free")
    assert made.drive.level.max() == pytest.approx(1.0)
    assert made.error.max() < 0.2


def test_frames_between_are_like_frames_from_scratch_but_for_a_sudden_target(solved):
    wanted = target(0.05, frames=40)
    alone, between = (solve(wanted, UNIT, method=Free(every=every)) for every in (1, 4))
    assert between.iterations.sum() < 0.5 * alone.iterations.sum()
    np.testing.assert_allclose(between.error, alone.error, atol=0.01)
    wanted = target(0.05)
    mixed = replace(wanted, amplitude=np.concatenate([wanted.amplitude[[0] * 4], wanted.amplitude[[8] * 5]]))
    made = solve(mixed, UNIT, method=Free(every=8))
    assert made.error.max() < 0.025
    assert made.iterations[1] > 10 or made.iterations[5] > 10
