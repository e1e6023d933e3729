import numpy as np
import pytest

from midair.correct.envelope_prediction import EnvelopeTracking
from midair.model import ControlGrid, Drive, SensorGrid, TransducerArray
from midair.physics import PlaybackChain, SensorModel, Transducers, cell_weights, middle_of, simulate, transfer_matrix

ARRAY = TransducerArray.autd3(columns=1, rows=1)
GRID = ControlGrid(rows=6, columns=6, pitch=5e-3, height=0.12)
WEIGHTS = cell_weights(SensorModel(grid=SensorGrid(rows=2, columns=2)), GRID, between="waves")
SPREAD = Transducers.varied(ARRAY.count, seed=3, gain_spread=0.1, resonance_spread=100, quality_spread=0.1)
FRAMES, MIDDLE = 12, middle_of(GRID)


@pytest.fixture
def drive():
    phase = 0.3 * np.random.default_rng(0).normal(size=(FRAMES, ARRAY.count)).cumsum(axis=0)
    return Drive(phase=phase, level=np.linspace(0.5, 1, FRAMES), rate=4e3, array=ARRAY)


def command(drive):
    return (drive.level[:, None] * np.exp(1j * np.asarray(drive.phase))).astype(np.complex64)


def test_the_pressure_agrees_with_the_playback_simulation(drive):
    tracking = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE)
    chain = PlaybackChain(phase_bits=None, transducers=SPREAD, precision="double")
    expected = simulate(drive, transfer_matrix(GRID, ARRAY), chain=chain, rate=drive.rate, weights=WEIGHTS)
    start, none = np.zeros(ARRAY.count, np.complex64), np.zeros((FRAMES, 4), np.float32)
    cost, _ = tracking.cost(command(drive), start, none, np.eye(FRAMES, dtype=np.float32))
    assert cost == pytest.approx(0.5 * (expected**2).sum(), rel=1e-4)


def test_the_slope_is_the_derivative_by_central_differences(drive):
    tracking, rng = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE), np.random.default_rng(1)
    mixed = rng.normal(size=(FRAMES, FRAMES))
    metric = (mixed @ mixed.T).astype(np.float32)
    wanted = rng.uniform(0, 1, (FRAMES, 4)).astype(np.float32)
    start, turn = command(drive)[0], rng.normal(size=(FRAMES, ARRAY.count))
    _, slope = tracking.cost(command(drive), start, wanted, metric)
    above, below = (
        tracking.cost((command(drive) * np.exp(1j * by * turn)).astype(np.complex64), start, wanted, metric)[0]
        for by in (3e-3, -3e-3)
    )
    assert (slope * turn).sum() == pytest.approx((above - below) / 6e-3, rel=1e-2)


def test_a_stretch_goes_on_from_the_one_before_it(drive):
    tracking = EnvelopeTracking.of(drive, SPREAD, GRID.position, WEIGHTS, MIDDLE)
    start = np.zeros(ARRAY.count, np.complex64)
    whole = tracking.radiated(command(drive), start)
    first = tracking.radiated(command(drive)[:5], start)
    second = tracking.radiated(command(drive)[5:], first[-1])
    np.testing.assert_allclose(np.concatenate([first, second]), whole, atol=1e-6)
