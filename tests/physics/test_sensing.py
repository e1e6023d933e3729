from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.signal import lsim, lti
from scipy.special import ndtr

from midair.model import Acoustics, ControlGrid, SensorGrid, TransducerArray
from midair.physics import (
    SensorModel,
    calibration_of,
    cell_weights,
    channel_response,
    sense,
    storage_precision,
    transfer_matrix,
)

RATE = 1000.0
QUIET = SensorModel(bits=32, full_scale=1000.0)  # steps of .5 microvolt: what is left is the response


def analogue(model):
    """The same channel as polynomials in s, from its parts."""
    fall = 1 / (2 * np.pi * model.high_pass)
    swing = 1 / (2 * np.pi * model.resonance)
    below = np.polymul([model.relaxation, 1], np.polymul([fall, 1], [swing**2, swing / model.quality, 1]))
    return lti([model.sensitivity * fall, 0], below)


def tone(frequency, frames, rate=RATE, shape=(4, 4)):
    wave = np.sin(2 * np.pi * frequency * np.arange(frames) / rate)
    return np.broadcast_to(wave[:, None, None], (frames, *shape))


def test_the_response_is_its_transfer_function_also_at_frequencies_by_hand():
    frequency = np.array([0.0, 1.0, 20.0, 100.0, 470.0, 1500.0])
    wanted = analogue(QUIET).freqresp(2 * np.pi * frequency)[1]
    response = channel_response(QUIET, frequency)
    assert response.shape == (6, 4, 4)
    assert response[:, 1, 2] == pytest.approx(wanted, rel=1e-9, abs=1e-15)
    bare = SensorModel(relaxation=0.0, resonance=1e9, sensitivity=0.01)
    at_corner, far_above = channel_response(bare, np.array([20.0, 2e4]))[:, 0, 0]
    assert at_corner == pytest.approx(0.01 * (0.5 + 0.5j), rel=1e-6)
    assert abs(far_above) == pytest.approx(0.01, rel=1e-5)
    assert channel_response(bare, np.zeros(1))[0, 0, 0] == 0


def test_a_tone_agrees_with_the_response(subtests):
    for frequency in [10.0, 25.0, 100.0, 250.0, 470.0]:
        with subtests.test(frequency=frequency):
            model = QUIET.with_spread(seed=2)
            volts = sense(model, tone(frequency, 3000), RATE)[1000:2500]
            turn = np.exp(-2j * np.pi * frequency * np.arange(1000, 2500) / RATE)
            measured = 2j * np.mean(volts * turn[:, None, None], axis=0)
            assert measured == pytest.approx(channel_response(model, np.array([frequency]))[0], rel=2e-3)


def test_a_step_in_fine_time_agrees_with_the_differential_equation():
    # At 64 kHz a smooth push is as good as continuous; scipy integrates the polynomials in s.
    rate, frames = 64000.0, 12800
    time = np.arange(frames) / rate
    push = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - 0.02) / 0.01, 0, 1))
    wanted = lsim(analogue(QUIET), push, time)[1]
    volts = sense(QUIET, np.broadcast_to(push[:, None, None], (frames, 4, 4)), rate)
    assert volts[:, 3, 0] == pytest.approx(wanted, abs=4e-6)


def test_later_pressure_hardly_changes_earlier_readings():
    time = np.arange(8 * 600) / 8000
    push = 30 * (0.5 - 0.5 * np.cos(2 * np.pi * 100 * time))
    whole = np.broadcast_to(push[:, None, None], (len(push), 4, 4))
    first = sense(QUIET, whole[: 8 * 297], RATE, oversample=8)
    swing = np.ptp(sense(QUIET, whole, RATE, oversample=8))
    error = np.abs(first - sense(QUIET, whole, RATE, oversample=8)[:297])
    assert error[:290].max() < 1e-3 * swing
    assert error.max() < 5e-3 * swing


def test_oversampled_pressure_gives_the_same_samples_and_does_not_alias():
    model = QUIET.with_spread(seed=4)
    time = np.arange(8 * 1200) / 8000
    rise = np.clip(time / 0.2, 0, 1) * np.clip((1.2 - time) / 0.2, 0, 1)
    wave = (np.sin(np.pi / 2 * rise) ** 2 * (np.sin(2 * np.pi * 90 * time) + np.sin(2 * np.pi * 310 * time)))[:, None]
    fine = np.broadcast_to(wave[:, None], (len(wave), 4, 4))
    assert sense(model, fine, RATE, oversample=8) == pytest.approx(sense(model, fine[::8], RATE), abs=1e-6)
    high = tone(900.0, 8 * 1000, rate=8000.0) * np.hanning(8000)[:, None, None]
    assert np.abs(sense(QUIET, high, RATE, oversample=8)).max() < 1e-5
    folded = sense(QUIET, high[::8], RATE)
    assert np.abs(folded).max() > 0.01  # without the filter it would


def test_noise_has_its_density():
    model = SensorModel(noise=1e-3)
    volts = sense(model, np.zeros((20000, 4, 4)), RATE, rng=np.random.default_rng(0))
    assert volts.std(axis=0) == pytest.approx(np.full((4, 4), 1e-3 * np.sqrt(500)), rel=0.03)
    again = sense(model, np.zeros((20000, 4, 4)), RATE, rng=np.random.default_rng(0))
    assert (again == volts).all()


def test_the_converter_clips_and_rounds_and_an_amplifier_saturates():
    model = SensorModel(full_scale=1.0, bits=8)
    volts = sense(model, 200 * tone(100.0, 500), RATE)
    assert volts.min() == -1.0
    assert volts.max() == 1.0 - 2 / 256
    assert volts / (2 / 256) == pytest.approx(np.rint(volts / (2 / 256)), abs=1e-9)
    assert len(np.unique(sense(SensorModel(bits=1), tone(100.0, 500), RATE))) <= 2
    model = SensorModel(bits=32, full_scale=1000.0, saturation=0.5)
    plain = sense(QUIET, 100 * tone(100.0, 500), RATE)
    assert sense(model, 100 * tone(100.0, 500), RATE) == pytest.approx(0.5 * np.tanh(plain / 0.5), abs=1e-5)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(-2, 2), st.floats(-2, 2))
def test_sensing_is_linear_until_the_converter(seed, a, b):
    x, y = np.random.default_rng(seed).standard_normal((2, 100, 4, 4))
    both = sense(QUIET, a * x + b * y, RATE)
    assert both == pytest.approx(a * sense(QUIET, x, RATE) + b * sense(QUIET, y, RATE), abs=4 * QUIET.step)


def test_a_seed_makes_one_sensor():
    one, same, other = (SensorModel().with_spread(seed=seed) for seed in (1, 1, 2))
    assert (one.gain == same.gain).all()
    assert (one.corner == same.corner).all()
    assert (one.gain != other.gain).all()
    spread = SensorModel(grid=SensorGrid(rows=40, columns=40)).with_spread(seed=0, gain=0.2, corner=0.05)
    assert np.log(spread.gain).std() == pytest.approx(0.2, rel=0.1)
    assert np.log(spread.corner).std() == pytest.approx(0.05, rel=0.1)


def test_the_calibration_of_a_model_is_its_response():
    model = SensorModel().with_spread(seed=3)
    calibration = calibration_of(model)
    frequency = np.linspace(1, 500, 997)
    error = np.abs(calibration.response_at(frequency) - channel_response(model, frequency))
    assert (error / np.abs(channel_response(model, frequency))).max() < 3e-5
    assert calibration.unit == "V"
    assert calibration.noise.tolist() == np.full((4, 4), model.noise).tolist()
    assert calibration.provenance.simulated


def test_a_delay_turns_the_phase_only():
    delay = np.linspace(0, 3e-4, 16).reshape(4, 4)
    late = SensorModel(bits=32, full_scale=1000.0, delay=delay)
    frequency = np.array([30.0, 200.0, 450.0])
    turned = channel_response(late, frequency) / channel_response(QUIET, frequency)
    assert np.abs(turned) == pytest.approx(np.ones((3, 4, 4)))
    assert np.angle(turned) == pytest.approx(-2 * np.pi * frequency[:, None, None] * delay)


def test_cells_feel_each_other():
    mixed = np.eye(16)
    mixed[5, 6] = 0.25
    model = SensorModel(bits=32, full_scale=1000.0, crosstalk=mixed)
    pressure = np.zeros((400, 4, 4))
    pressure[:, 1, 2] = 20 * np.sin(2 * np.pi * 0.1 * np.arange(400))
    volts = sense(model, pressure, RATE)
    assert volts[:, 1, 1] == pytest.approx(0.25 * volts[:, 1, 2], abs=2 * model.step)
    assert np.abs(np.delete(volts.reshape(-1, 16), [5, 6], axis=1)).max() < 2 * model.step
    assert calibration_of(model).crosstalk.matrix[5, 6] == 0.25
    assert calibration_of(QUIET).crosstalk is None


ALONE = SensorModel(grid=SensorGrid(rows=1, columns=1))


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(["steps", "lines"]),
    st.floats(0.2e-3, 6e-3),
    st.floats(1e-3, 11e-3),
    st.floats(1e-3, 6e-3),
    st.floats(-3e-3, 3e-3),
    st.floats(-3e-3, 3e-3),
)
def test_an_even_pressure_reads_itself_whatever_the_sensor(between, spread, aperture, pitch, x, y):
    model = SensorModel(spread=spread, aperture=aperture)
    count = int(np.ceil(0.12 / pitch))
    points = ControlGrid(rows=count, columns=count, pitch=pitch)
    weights = cell_weights(model, points, centre=(x, y), between=between)
    assert weights.shape == (16, count**2)
    assert weights.sum(axis=1) == pytest.approx(np.ones(16), abs=1e-9)
    assert weights.min() >= -1e-11


def test_weights_are_shares_of_the_aperture_and_integrals_over_the_plane():
    # 1 cell of 8 mm, points of 4 mm: the middle two of four hold half each, along both axes
    model = SensorModel(grid=SensorGrid(rows=1, columns=1), spread=1e-9, aperture=8e-3)
    weights = cell_weights(model, ControlGrid(rows=4, columns=4, pitch=4e-3)).reshape(4, 4)
    half = np.array([0, 0.5, 0.5, 0])
    assert weights == pytest.approx(np.outer(half, half), abs=1e-6)
    model = SensorModel(spread=2e-3, aperture=8e-3)
    grid = ControlGrid()
    weights = cell_weights(model, grid).reshape(16, 16, 16)
    # one point's square, by sums over a fine raster: spread by the gel, averaged over cell 5 (row 1, column 1)
    fine = (np.arange(200) + 0.5) / 200 - 0.5
    from_x = grid.x[6] + fine * grid.pitch
    cell_x = model.grid.x[1] + fine * model.aperture
    spread = np.exp(-(((from_x[:, None] - cell_x) / model.spread) ** 2) / 2) / (model.spread * np.sqrt(2 * np.pi))
    assert weights[5, :, 6].sum() == pytest.approx(spread.mean() * grid.pitch, rel=1e-4)


def test_each_cell_reads_the_pressure_above_it():
    sensor, grid = SensorGrid(rows=2, columns=3), ControlGrid(rows=20, columns=22, pitch=3e-3, centre=(2e-3, 5e-3))
    for between, centre in product(["steps", "lines"], [(0.0, 0.0), (4e-3, -7e-3)]):
        weights = cell_weights(SensorModel(grid=sensor), grid, centre=centre, between=between)
        # the centroid of a cell's weights is the cell's position, except for the steps of the grid
        places = [np.add(sensor.channel_position(channel), centre) for channel in range(sensor.count)]
        assert weights @ grid.position[:, :2] == pytest.approx(np.array(places), abs=2e-4), (between, centre)


def heard(x, model=ALONE):
    """Share of a pressure at x in the mean of a cell at 0, along one axis, by definition."""
    ends = (x + model.aperture / 2, x - model.aperture / 2)
    return (ndtr(ends[0] / model.spread) - ndtr(ends[1] / model.spread)) / model.aperture


def test_lines_agree_with_an_integral_of_the_interpolated_pressure():
    points = ControlGrid(rows=9, columns=9, pitch=3e-3)
    pressure = np.random.default_rng(0).uniform(0, 1, 9)
    weights = cell_weights(ALONE, points, centre=(1e-3, 0.5e-3), between="lines").reshape(9, 9)

    def pressed(x):
        return heard(x - 1e-3) * np.interp(x, points.x, pressure, left=0, right=0)

    expected = quad(pressed, points.x[0], points.x[-1], points=list(points.x), limit=200)[0]
    # An even pressure along y, so that only its ends, where it fades over one pitch, are missing.
    assert weights.sum(axis=0) @ pressure == pytest.approx(expected, rel=1e-6)


@pytest.mark.long
def test_waves_are_exact_below_half_the_points():
    """A cosine is multiplied by the window's spectrum, sinc(f a) exp(-2 (pi f s)^2)."""
    points, a, s = ControlGrid(rows=1, columns=801, pitch=3e-3), ALONE.aperture, ALONE.spread
    weights = cell_weights(ALONE, points, between="waves")[0]
    for f in (0.0, 40.0, 110.0, 160.0):
        read = weights @ np.cos(2 * np.pi * f * points.x) / weights.sum()
        assert read == pytest.approx(np.sinc(f * a) * np.exp(-2 * (np.pi * f * s) ** 2), abs=2e-3), f


@pytest.mark.long
def test_sixteen_points_suffice_for_the_reading_of_a_cell():
    """Means of the squared field of four units, from 16 x 16 points and from points four times as close."""
    array, rng = TransducerArray.autd3(), np.random.default_rng(0)
    sensor = SensorModel(grid=SensorGrid(rows=3, columns=3, pitch=5e-3))
    q = np.exp(1j * rng.uniform(-np.pi, np.pi, array.count))
    q *= np.exp(1j * np.angle(transfer_matrix(np.array([[2e-3, 1e-3, 0.2]]), array)[0].conj()))
    read = []
    for points, between in ((ControlGrid(), "waves"), (ControlGrid(rows=64, columns=64, pitch=11e-3 / 12), "steps")):
        field = np.abs(transfer_matrix(points, array, acoustics=Acoustics()) @ q) ** 2
        read.append(cell_weights(sensor, points, between=between) @ field)
    assert np.linalg.norm(read[0] - read[1]) < 0.01 * np.linalg.norm(read[1])


def test_it_is_single_where_float32_holds_every_step(subtests):
    for bits, stored in [(16, "f4"), (24, "f8")]:
        with subtests.test(bits=bits):
            model = SensorModel(bits=bits)
            half = 2 ** (bits - 1)
            steps = np.arange(-half, half, max(1, bits**3 // 7)) * model.step
            assert (steps.astype(np.float32) == steps).all() == (stored == "f4")
            assert storage_precision(model) == stored
