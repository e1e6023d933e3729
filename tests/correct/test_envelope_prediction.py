"""Envelope prediction on one unit, in a playback simulation with a different pole for each transducer."""

from dataclasses import replace

import numpy as np
import pytest

from midair.correct import EnvelopePrediction
from midair.correct.envelope_prediction import EnvelopeTracking
from midair.model import AmplitudeFrames, ControlGrid, Drive, SensorGrid, Solution, TransducerArray
from midair.physics import (
    PlaybackChain,
    SensorModel,
    TransducerDynamics,
    Transducers,
    cell_weights,
    focus_phase,
    middle_of,
    radiation_pressure,
    simulate,
    transfer_matrix,
)

GRID = ControlGrid(rows=6, columns=6, pitch=5e-3, height=0.12)
PLACES = SensorModel(grid=SensorGrid(rows=3, columns=3, pitch=6e-3))
SPREAD = Transducers.varied(249, seed=3, gain_spread=0.1, resonance_spread=100, quality_spread=0.1)
ARRAY = replace(TransducerArray.autd3(columns=1, rows=1), response=SPREAD.response, pole=SPREAD.pole)
WAY = EnvelopePrediction(transducers=SPREAD, dynamics=TransducerDynamics(), places=PLACES, block=32)
FRAMES = 80


@pytest.fixture(scope="module")
def asked():
    """A focus that moves back and forth; the target is its field with 10 % modulation at 200 Hz."""
    time = np.arange(FRAMES) / 4e3
    focus = [focus_phase(ARRAY, np.array([6e-3 * np.sin(2 * np.pi * 30 * at), 0, 0.12])) for at in time]
    drive = Drive(phase=np.mod(focus, 2 * np.pi), level=np.full(FRAMES, 0.8), rate=4e3, array=ARRAY)
    field = 0.8 * np.abs(np.exp(1j * np.asarray(drive.phase)) @ transfer_matrix(GRID, ARRAY).T)
    beat = 1 + 0.1 * np.sin(2 * np.pi * 200 * time)[:, None]
    solution = Solution(
        drive=drive, error=np.zeros(FRAMES), iterations=np.ones(FRAMES, np.int64), status=("iterations",) * FRAMES
    )
    return solution, AmplitudeFrames(amplitude=field * beat, rate=4e3, grid=GRID)


def missed(drive, target):
    """Rms error of the pressure at the places, averaged over 1 ms, in Pa."""
    chain = PlaybackChain(phase_bits=None, transducers=SPREAD)
    G = transfer_matrix(GRID, ARRAY.nominal)
    drawn, waves = (cell_weights(PLACES, GRID, between=each) for each in ("lines", "waves"))
    played = simulate(drive, G, chain=chain, rate=drive.rate, weights=waves)
    nominal, now = np.exp(complex(-1 / 188e-6, 2 * np.pi * 205) / 4e3), 0
    follows = [now := amplitude + (now - amplitude) * nominal for amplitude in target.amplitude]
    wanted = radiation_pressure(np.real(follows), drive.acoustics.medium) @ drawn.T
    smooth = np.apply_along_axis(np.convolve, 0, played - wanted, np.ones(4) / 4, "valid")
    return float(np.sqrt((smooth[4:-4] ** 2).mean()))


def parts_of(solution, size):
    return iter([solution.cut(at, min(at + size, FRAMES)) for at in range(0, FRAMES, size)])


def test_the_predicted_error_is_corrected(asked):
    solution, target = asked
    mended = Solution.joined(list(WAY.corrected(iter([solution]), target)))
    assert missed(mended.drive, target) < 0.7 * missed(solution.drive, target)
    turned = np.angle(np.exp(1j * (mended.drive.phase - solution.drive.phase)))
    assert np.sqrt((turned**2).mean()) < 0.5
    assert [step.stage for step in mended.drive.provenance.steps] == ["foresee the array"]
    np.testing.assert_array_equal(mended.drive.level, solution.drive.level)


def test_silent_points_stay_silent(asked):
    """Without them, the correction raises the pressure beside the places."""
    solution, target = asked
    points = np.array([[x, y, 0.12] for x in (-30e-3, 30e-3) for y in (-10e-3, 0, 10e-3)])
    G = transfer_matrix(points, ARRAY)
    way = replace(WAY, iterations=20)
    loud, quiet = (
        np.abs(Solution.joined(list(each.corrected(iter([solution]), target))).drive.q @ G.T) ** 2
        for each in (way, replace(way, silent=points))
    )
    assert quiet.mean() < 0.9 * loud.mean()


def test_blocks_are_the_same_bits_whatever_the_parts_and_have_no_seam(asked):
    solution, target = asked
    whole = list(WAY.corrected(iter([solution]), target))
    assert [part.drive.frames for part in whole] == [32, 32, 16]
    for size in (7, 50):
        parts = list(WAY.corrected(parts_of(solution, size), target))
        for one, other in zip(whole, parts, strict=True):
            np.testing.assert_array_equal(one.drive.phase, other.drive.phase)
    # One block of all frames and many blocks correct equally well.
    solution, target = asked
    one, many = (
        missed(Solution.joined(list(replace(WAY, block=size).corrected(iter([solution]), target))).drive, target)
        for size in (FRAMES, 16)
    )
    assert many < 1.2 * one


def test_silent_frames_do_not_change(asked):
    solution, target = asked
    drive = replace(solution.drive, level=np.where(np.arange(FRAMES) < 40, 0.0, 0.8))
    quiet = np.array(target.amplitude)
    quiet[:40] = 0
    mended = list(WAY.corrected(iter([replace(solution, drive=drive)]), replace(target, amplitude=quiet)))
    np.testing.assert_array_equal(mended[0].drive.phase, np.mod(drive.phase[:32], 2 * np.pi))


def test_the_low_pass_is_of_the_band():
    metric = WAY.metric(slice(12, 44), 56, 4e3)
    np.testing.assert_allclose(metric, metric.T, atol=1e-7)
    slow, fast = np.ones(56), (-1.0) ** np.arange(56)
    assert slow @ metric @ slow == pytest.approx(32 + 8 + 32 * 0.05, rel=0.05)
    assert fast @ metric @ fast == pytest.approx(32 * 0.05, rel=0.2)
    # At 1 kHz all playable frequencies are in the band.
    np.testing.assert_allclose(np.diag(WAY.metric(slice(0, 8), 20, 1e3))[:8], 1.05)


WEIGHTS = cell_weights(SensorModel(grid=SensorGrid(rows=2, columns=2)), GRID, between="waves")
FEW, MIDDLE, NOMINAL = 12, middle_of(GRID), ARRAY.nominal


@pytest.fixture
def drive():
    phase = 0.3 * np.random.default_rng(0).normal(size=(FEW, NOMINAL.count)).cumsum(axis=0)
    return Drive(phase=phase, level=np.linspace(0.5, 1, FEW), rate=4e3, array=NOMINAL)


def command(drive):
    return (drive.level[:, None] * np.exp(1j * np.asarray(drive.phase))).astype(np.complex64)


def test_the_pressure_agrees_with_the_playback_simulation(drive):
    tracking = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE)
    chain = PlaybackChain(phase_bits=None, transducers=SPREAD, precision="double")
    expected = simulate(drive, transfer_matrix(GRID, NOMINAL), chain=chain, rate=drive.rate, weights=WEIGHTS)
    start, none = np.zeros(NOMINAL.count, np.complex64), np.zeros((FEW, 4), np.float32)
    cost, _ = tracking.cost(command(drive), start, none, np.eye(FEW, dtype=np.float32))
    assert cost == pytest.approx(0.5 * (expected**2).sum(), rel=1e-4)


def test_the_slope_is_the_derivative_by_central_differences(drive):
    tracking, rng = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE), np.random.default_rng(1)
    mixed = rng.normal(size=(FEW, FEW))
    metric = (mixed @ mixed.T).astype(np.float32)
    wanted = rng.uniform(0, 1, (FEW, 4)).astype(np.float32)
    start, turn = command(drive)[0], rng.normal(size=(FEW, NOMINAL.count))
    _, slope = tracking.cost(command(drive), start, wanted, metric)
    above, below = (
        tracking.cost((command(drive) * np.exp(1j * by * turn)).astype(np.complex64), start, wanted, metric)[0]
        for by in (3e-3, -3e-3)
    )
    assert (slope * turn).sum() == pytest.approx((above - below) / 6e-3, rel=1e-2)


def test_a_stretch_goes_on_from_the_one_before_it(drive):
    tracking = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE)
    start = np.zeros(NOMINAL.count, np.complex64)
    whole = tracking.radiated(command(drive), start)
    first = tracking.radiated(command(drive)[:5], start)
    second = tracking.radiated(command(drive)[5:], first[-1])
    np.testing.assert_allclose(np.concatenate([first, second]), whole, atol=1e-6)
