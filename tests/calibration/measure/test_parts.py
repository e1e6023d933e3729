"""Delay, noise, crosstalk, linearity: the hand-checked numbers and laws of each."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.calibration import noise_equivalent_pressure, undo_crosstalk, undo_matrix
from midair.calibration.measure.delay import channel_delay, upper_half
from midair.calibration.measure.excitation import noise_signal, sweep_signal, tone_signal
from midair.calibration.measure.linearity import bend_uncertainty, distinct, fit_levels, same_levels
from midair.calibration.measure.noise import quiet_density, white_level
from midair.errors import BandError, InputError, MismatchError
from midair.model import Calibration, Crosstalk, Measurement, PressureFrames, Recording, SensorGrid

FREQUENCY = np.arange(100.0, 400.0, 2.0)


def test_a_pure_delay_comes_out():
    response = np.exp(-2j * np.pi * FREQUENCY[:, None] * np.array([0, 1e-4, 3e-3])) * np.array([2, 0.5j, -1])
    delay, unsure = channel_delay(FREQUENCY, response, np.full((150, 3), 0.01))
    assert delay == pytest.approx([0, 1e-4, 3e-3], abs=1e-12)
    # u = .01 / (2 pi sqrt(sum (f - mean)^2)) = .01 / (2 pi 1060.6 Hz)
    assert unsure == pytest.approx(np.full(3, 0.01 / (2 * np.pi * 1060.6)), rel=1e-4)


def test_delays_of_noisy_phases_scatter_as_stated():
    rng = np.random.default_rng(0)
    phase = 0.02 * rng.standard_normal((150, 400)) - 2 * np.pi * 5e-4 * FREQUENCY[:, None]
    delay, unsure = channel_delay(FREQUENCY, np.exp(1j * phase), np.full((150, 400), 0.02))
    assert ((delay - 5e-4) / unsure).std() == pytest.approx(1, abs=0.1)


def test_a_deaf_channel_has_no_delay():
    delay, unsure = channel_delay(FREQUENCY, np.zeros((150, 1)), np.full((150, 1), np.inf))
    assert (delay[0], unsure[0]) == (0, np.inf)
    with pytest.raises(BandError, match="three bins"):
        channel_delay(FREQUENCY[:2], np.ones((2, 1)), np.ones((2, 1)))


def test_the_upper_half():
    assert FREQUENCY[upper_half(FREQUENCY)][0] == 250
    assert len(FREQUENCY[:3][upper_half(FREQUENCY[:3])]) == 3


def test_white_noise_has_its_density_and_the_stated_scatter():
    rng = np.random.default_rng(1)
    sensor = SensorGrid(rows=1, columns=300)
    quiet = Recording(samples=0.2 * rng.standard_normal((8000, 1, 300)), rate=1000.0, sensor=sensor)
    frequency, density, averages = quiet_density(quiet, resolution=1.0, width=2.0)
    assert frequency[0] < 4
    assert density.mean() == pytest.approx(0.04 / 500, rel=0.005)
    level, unsure = white_level(density, averages, 2.0)
    score = (level / level.mean() - 1) / unsure
    assert 0.75 < score.std() < 1.25


def flat(noise, *, density=None, response=0.02, sensor=None):
    sensor = sensor or SensorGrid(rows=1, columns=2)
    bins = (3, *sensor.shape)
    zero = np.zeros(sensor.shape)
    measured = None
    if density is not None:
        measured = Measurement(
            coherence=np.ones(bins),
            magnitude_uncertainty=np.zeros(bins),
            phase_uncertainty=np.zeros(bins),
            noise_density=np.broadcast_to(np.reshape(density, (3, 1, 1)), bins),
            noise_uncertainty=zero,
            delay=zero,
            delay_uncertainty=zero,
        )
    return Calibration(
        sensor=sensor,
        frequency=np.array([0.0, 100.0, 500.0]),
        response=np.full(bins, response),
        noise=np.full(sensor.shape, noise),
        measurement=measured,
    )


def test_noise_equivalent_pressure_at_hand_computed_numbers():
    # 20 uV/sqrt(Hz) over 20 mV/Pa in 450 Hz: 1 mPa/sqrt(Hz) * 21.2
    assert noise_equivalent_pressure(flat(20e-6)) == pytest.approx(np.full((1, 2), 1e-3 * np.sqrt(450)))
    # a density that falls from 2 to 0 mPa/sqrt(Hz) over 100 to 500 Hz: sqrt(integral of (2 x/400)^2) = 2 sqrt(400/3)
    slope = flat(0, density=[4e-5, 4e-5, 0])
    assert noise_equivalent_pressure(slope, (100, 500)) == pytest.approx(
        np.full((1, 2), 2e-3 * np.sqrt(400 / 3)), rel=1e-4
    )
    assert np.isinf(noise_equivalent_pressure(flat(1e-6, response=0.0))).all()
    with pytest.raises(BandError, match="within 0 to 500 Hz, got 20 to 600 Hz"):
        noise_equivalent_pressure(flat(1e-6), (20, 600))


def crosstalk(matrix):
    return Crosstalk(matrix=np.array(matrix, float), uncertainty=np.zeros(np.shape(matrix)))


def test_undoing_at_hand_computed_numbers():
    # [[1, .5], [0, 1]]: what the second cell adds to the first is taken off again
    assert undo_matrix(crosstalk([[1, 0.5], [0, 1]])) == pytest.approx(np.array([[1, -0.5], [0, 1]]))
    # a scalar-like case: C = [[1, c], [c, 1]], d: on the difference mode 1 - c, (1 - c + d^2) / ((1 - c)^2 + d^2)
    c, d = 0.5, 0.3
    undone = undo_matrix(crosstalk([[1, c], [c, 1]]), damping=d) @ [1, -1]
    assert undone == pytest.approx(np.array([1, -1]) * (1 - c + d**2) / ((1 - c) ** 2 + d**2))


@given(st.integers(0, 2**32 - 1), st.floats(0, 0.1))
def test_what_was_mixed_comes_back(seed, strength):
    rng = np.random.default_rng(seed)
    matrix = strength * rng.uniform(-1, 1, (6, 6))
    np.fill_diagonal(matrix, 1)
    pressure = rng.standard_normal((50, 2, 3))
    felt = (pressure.reshape(50, 6) @ matrix.T).reshape(50, 2, 3)
    frames = PressureFrames(pressure=felt, rate=1000.0, sensor=SensorGrid(rows=2, columns=3))
    undone = undo_crosstalk(frames, crosstalk(matrix))
    assert undone.pressure == pytest.approx(pressure, abs=1e-9)
    assert undone.provenance.steps[-1].stage == "undo crosstalk"
    # heavily damped it is left alone
    assert undo_crosstalk(frames, crosstalk(matrix), damping=1e4).pressure == pytest.approx(felt, abs=1e-6)


def test_bad_crosstalk_is_refused():
    even = crosstalk(np.ones((2, 2)))
    with pytest.raises(InputError, match="condition"):
        undo_matrix(even)
    assert np.isfinite(undo_matrix(even, damping=0.1)).all()
    with pytest.raises(InputError, match="damping"):
        undo_matrix(even, damping=-1.0)
    with pytest.raises(MismatchError, match="16 channels like the pressure, got 2"):
        undo_crosstalk(PressureFrames(pressure=np.ones((3, 4, 4)), rate=1.0), even)


def levels(x, y, noise=0.0):
    x, y = (np.reshape(np.asarray(values, float), (-1, 1, 1)) for values in (x, y))
    return fit_levels(x, y, np.full(x.shape, noise))


def test_a_line_and_a_parabola_at_hand_computed_numbers():
    x = np.array([1.0, 2, 3, 4, 5])
    line = levels(x, 0.5 + 2 * x)
    assert (line.gain[0, 0], line.intercept[0, 0]) == (pytest.approx(2), pytest.approx(0.5))
    assert line.curvature[0, 0] == pytest.approx(0, abs=1e-9)
    # y = x - .01 x^2: the line's slope is 1 - .06, the parabola's falls by .08 over 1 to 5
    bent = levels(x, x - 0.01 * x**2)
    assert bent.gain[0, 0] == pytest.approx(0.94)
    assert bent.curvature[0, 0] == pytest.approx(-0.08 / 0.94)


def test_known_noise_is_a_lower_bound_of_the_errors():
    x = np.array([1.0, 2, 3, 4, 5])
    line = levels(x, 2 * x, noise=0.1)
    # .1 / sqrt(sum (x - 3)^2) = .1 / sqrt(10)
    assert line.gain_uncertainty[0, 0] == pytest.approx(0.1 / np.sqrt(10))
    assert line.intercept_uncertainty[0, 0] == pytest.approx(0.1 * np.sqrt(1 / 5 + 9 / 10))


def test_lines_through_noise_are_as_unsure_as_they_say():
    rng = np.random.default_rng(3)
    x = np.broadcast_to(np.array([1.0, 2, 4, 8, 16]).reshape(5, 1, 1), (5, 1, 4000))
    y = x + 0.05 * rng.standard_normal(x.shape)
    line = fit_levels(x, y, np.zeros(x.shape))
    for value, unsure in (
        (line.gain - 1, line.gain_uncertainty),
        (line.intercept, line.intercept_uncertainty),
        (line.curvature, line.curvature_uncertainty),
    ):
        # Student's t has been allowed for: k = 2 covers 95.3 % with 3 degrees of freedom, 95.3 % with 2
        assert (np.abs(value) < 2 * unsure).mean() == pytest.approx(0.953, abs=0.012)


def test_levels_that_differ():
    assert distinct(np.array([3.0, 1.0, 1.02, 2.0, 3.1])).tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match="at least 5 different ones, got 4"):
        levels([1, 2, 3, 4, 4.1], [1, 2, 3, 4, 4])


def test_which_takes_make_the_levels():
    # five on all cells, in any order
    assert same_levels(np.array([5.0, 1, 2, 3, 4]), [None] * 5, 2).T.tolist() == [[1, 2, 3, 4, 0]] * 2
    # or five on each cell alone
    cells = [0] * 5 + [1] * 5
    found = same_levels(np.array([1.0, 2, 3, 4, 5, 5, 4, 3, 2, 1]), cells, 2)
    assert found.T.tolist() == [[0, 1, 2, 3, 4], [9, 8, 7, 6, 5]]
    assert same_levels(np.arange(1.0, 5), [None] * 4, 2) is None
    assert same_levels(np.arange(1.0, 10), cells[:9], 2) is None


def test_a_bend_is_an_even_distribution():
    share = np.array([[1.06, 1.0], [1.03, 1.0], [1.0, 1.001]])
    assert bend_uncertainty(share, np.full(share.shape, 0.001)) == pytest.approx([0.058 / np.sqrt(3), 0])


def test_signals_are_what_they_say():
    noise = noise_signal(3.0, 20, band=(50, 200), rng=np.random.default_rng(0))
    spectrum = np.abs(np.fft.rfft(noise)) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1e-3)
    assert noise.std() == pytest.approx(3.0)
    assert spectrum[(frequency < 49.9) | (frequency > 200.1)].sum() < 1e-20 * spectrum.sum()
    sweep = sweep_signal(2.0, 10, band=(20, 400), silence=0.5)
    assert len(sweep) == 11000
    assert not sweep[:500].any()
    assert not sweep[-500:].any()
    assert sweep[2000:9000].std() == pytest.approx(2.0, rel=0.01)
    # an exponential sweep passes the geometric mean of its band half way through: 89.4 Hz, a zero every 5.6 ms
    middle = sweep[5250:5750]
    assert np.count_nonzero(np.diff(np.sign(middle))) / 2 / 0.5 == pytest.approx(89.4, abs=2)
    assert tone_signal(10, 250.0, 1.0).std() == pytest.approx(10, rel=1e-6)
    with pytest.raises(InputError, match="above 0 Hz"):
        sweep_signal(1, 1, band=(0, 100))
