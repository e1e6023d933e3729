from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.correct import IterativeCorrection, Response, measured_response, minimum_norm
from midair.correct.iterative import slopes
from midair.dsp import band_window, filter_response
from midair.model import ControlGrid, Drive, SensorGrid, TransducerArray
from midair.physics import (
    PlaybackChain,
    SensorModel,
    Transducers,
    cell_weights,
    focus_phase,
    radiation_pressure,
    simulate,
    transfer_matrix,
)

RATE, BAND = 1000.0, (20.0, 470.0)


def noise(seed=0, frames=2000):
    x = np.random.default_rng(seed).standard_normal((frames, 2, 2))
    return in_band(x)


def in_band(x):
    return filter_response(x, RATE, lambda f: band_window(f, BAND, edges=(10.0, 20.0)).reshape(-1, 1, 1), reach=0.2)


def chain(x, corner=150.0):
    """A first-order low-pass and a gain of .7, as a model of a re-recording."""
    return filter_response(x, RATE, lambda f: (0.7 / (1 + 1j * f / corner)).reshape(-1, 1, 1), reach=0.2)


def test_the_response_of_a_known_filter_and_the_nearest_where_nothing_was_asked():
    found = measured_response(noise(), chain(noise()), RATE, band=BAND)
    frequency = np.array([60.0, 150.0, 400.0])
    assert found.at(frequency) == pytest.approx(0.7 / (1 + 1j * frequency / 150), abs=0.03)
    time = np.arange(2000) / RATE
    tone = np.sin(2 * np.pi * 100 * time)[:, None, None] * np.ones((1, 2, 2))
    found = measured_response(tone, 0.5 * tone, RATE, band=BAND)
    assert np.abs(found.value) == pytest.approx(np.full(len(found.value), 0.5), abs=0.01)


def test_one_whole_step_makes_a_linear_chain_right():
    """eps 0, g 1 and the true H: the next re-recording is the target."""
    target = noise()
    frequency = np.linspace(0, 500, 501)
    response = Response(frequency=frequency, value=0.7 / (1 + 1j * frequency / 150))
    lacking = target - chain(target)
    change = IterativeCorrection(regularisation=0.0).change(lacking, RATE, response, band=(5.0, 495.0), step=1.0)
    error = target - chain(target + change)
    middle = slice(200, -200)
    assert np.linalg.norm(error[middle]) < 0.01 * np.linalg.norm(lacking[middle])


@pytest.mark.long
@given(st.floats(0.1, 1.0), st.integers(0, 5))
def test_every_step_on_a_chain_that_only_pushes_brings_it_nearer(step, seed):
    """Projected on positive pressure, as in the half-wave mode: five steps, each with less error."""
    target = noise(seed, frames=600)
    asked = np.maximum(target, 0)
    correction, errors = IterativeCorrection(step=1.0), []
    for _ in range(6):
        heard = in_band(chain(asked))
        errors.append(np.linalg.norm(target - heard))
        response = measured_response(asked, heard, RATE, band=BAND)
        change = correction.change(target - heard, RATE, response, band=BAND, step=step)
        asked = np.maximum(asked + change, 0)
    assert (np.diff(errors) < 0).all()


def test_a_band_without_response_is_not_amplified_without_limit():
    frequency = np.linspace(0, 500, 51)
    response = Response(frequency=frequency, value=np.where(frequency < 200, 1.0, 1e-6).astype(complex))
    change = IterativeCorrection(regularisation=0.01).change(noise(), RATE, response, band=BAND, step=1.0)
    assert np.abs(change).max() < 2 * np.abs(noise()).max()


ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=8, columns=8, pitch=11e-3 / 3, height=0.12)
WEIGHTS = cell_weights(SensorModel(grid=SensorGrid(rows=2, columns=2)), GRID, between="waves")
G = transfer_matrix(GRID, ARRAY)
FRAMES = 40


def steady(level=1.0):
    """Foci out of phase with each other: some pressure on every cell, the same in every frame."""
    rng = np.random.default_rng(0)
    places = [(x, y, 0.12) for x in (-5e-3, 6e-3) for y in (-6e-3, 5e-3)]
    parts = [np.exp(1j * focus_phase(ARRAY, np.array(place))) for place in places]
    phase = np.angle(np.tensordot(np.exp(2j * np.pi * rng.uniform(size=4)), parts, axes=1))
    return Drive(
        phase=np.tile(np.mod(phase, 2 * np.pi), (FRAMES, 1)), level=np.full(FRAMES, level), rate=4e3, array=ARRAY
    )


def at_rest(drive):
    """Steady-state pressure on the cells of the last frame."""
    q = np.asarray(drive.level)[-1] * np.exp(1j * np.asarray(drive.phase)[-1])
    return WEIGHTS @ radiation_pressure(np.abs(G @ q), drive.acoustics.medium)


def test_the_slopes_are_the_derivative():
    rng = np.random.default_rng(1)
    theta, turn = rng.uniform(-np.pi, np.pi, (2, ARRAY.count))
    pressed = [WEIGHTS @ np.abs(G @ np.exp(1j * (theta + by * turn))) ** 2 for by in (-1e-5, 1e-5)]
    told = np.exp(1j * theta)[None]
    expected = (pressed[1] - pressed[0]) / 2e-5
    np.testing.assert_allclose(slopes(WEIGHTS, G, told @ G.T, told)[0] @ turn, expected, rtol=1e-3)


def test_the_missing_pressure_is_added():
    for drive in map(steady, (1.0, 0.6)):
        lacking = np.tile(0.01 * at_rest(drive) * np.array([1, -1, 1, 0]), (FRAMES, 1))
        better = minimum_norm(drive, lacking, WEIGHTS, GRID, floor=1e-6)
        gained = at_rest(better) - at_rest(drive)
        np.testing.assert_allclose(gained, lacking[-1], atol=0.05 * np.abs(lacking).max(), err_msg=str(drive.level[0]))
        assert better.provenance.steps[-1].stage == "correct the drive"


def test_no_smaller_change_presses_as_much():
    """Against the pseudo-inverse of the derivative by central differences, the minimum-norm step."""
    drive = steady()
    lacking = np.tile([0.05, 0.0, -0.02, 0.01], (FRAMES, 1))
    change = np.asarray(minimum_norm(drive, lacking, WEIGHTS, GRID, floor=1e-9).phase)[-1] - drive.phase[-1]
    told = np.exp(1j * np.asarray(drive.phase)[-1:])
    unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
    expected = np.linalg.pinv(unit * slopes(WEIGHTS, G, told @ G.T, told)[0]) @ lacking[-1]
    np.testing.assert_allclose(np.mod(change + np.pi, 2 * np.pi) - np.pi, expected, atol=0.03 * np.abs(expected).max())


def test_while_transducers_still_follow_the_field_is_the_one_they_make():
    """In a playback simulation from silence, the missing pressure is present in the middle of the frame."""
    chain = PlaybackChain(phase_bits=None, transducers=Transducers.alike(ARRAY.count), precision="double")
    drive = steady()

    def middle(one):
        return simulate(one, G, chain=chain, rate=2 * one.rate, weights=WEIGHTS)[::2]

    before = middle(drive)
    lacking = 0.005 * before * np.array([1, -1, 1, 0])
    gained = middle(minimum_norm(drive, lacking, WEIGHTS, GRID, floor=1e-9)) - before
    np.testing.assert_allclose(gained[6:], lacking[6:], atol=0.1 * lacking.max())


def test_silent_frames_and_blocks_change_nothing():
    drive = replace(steady(), level=np.where(np.arange(FRAMES) < 10, 0.0, 1.0))
    lacking = np.random.default_rng(3).normal(size=(FRAMES, 4))
    once, parts = (minimum_norm(drive, lacking, WEIGHTS, GRID, together=size) for size in (64, 7))
    np.testing.assert_array_equal(np.asarray(once.phase)[:10], np.asarray(drive.phase)[:10])
    np.testing.assert_allclose(np.exp(1j * np.asarray(once.phase)), np.exp(1j * np.asarray(parts.phase)), atol=1e-4)


def test_a_higher_floor_asks_for_less():
    drive, lacking = steady(), np.full((FRAMES, 4), 0.5)
    made = (minimum_norm(drive, lacking, WEIGHTS, GRID, floor=floor).phase for floor in (0.1, 10.0, 1000.0))
    sizes = [np.abs(np.exp(1j * (np.asarray(phase) - drive.phase)) - 1).max() for phase in made]
    assert sizes[0] > sizes[1] > sizes[2] > 0
