import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.calibration import noise_equivalent_pressure
from midair.calibration.measure.frequency_response import band_sums, quiet_density, solve_sums, white_level, widened
from midair.calibration.measure.referenced_take import noise_signal, sweep_signal
from midair.model import Calibration, Measurement, Recording, SensorGrid
from midair.physics import SensorModel, channel_response, sense

RATE = 1000.0
MODEL = SensorModel(bits=32, full_scale=1000.0).with_spread(seed=3)


def heard(x, *, noise=0.0, seed=0):
    volts = sense(MODEL, np.broadcast_to(x[:, None, None], (len(x), 4, 4)), RATE).reshape(len(x), 16)
    return volts + noise * np.random.default_rng(seed).standard_normal(volts.shape)


def fit(x, y, *, order=2, width=2.0):
    return solve_sums([band_sums(x[:, None], y, RATE, resolution=1.0, width=width, order=order)])


SIGNALS = {
    "noise": noise_signal(10, 20, rng=np.random.default_rng(0)),
    "a sweep": sweep_signal(10, 20),
    "two sweeps": np.tile(sweep_signal(10, 10), 2),
    "noise in part of it": np.pad(noise_signal(10, 15, rng=np.random.default_rng(1)), (2000, 3000)),
}


def test_the_noiseless_response_is_exact_for_any_signal():
    for name, signal in SIGNALS.items():
        found = fit(signal, heard(signal))
        band = (found.frequency >= 20) & (found.frequency <= 470)
        wanted = channel_response(MODEL, found.frequency).reshape(-1, 16)
        error = np.abs(found.response / wanted - 1)[band]
        assert error.max() < 1e-3, name
        assert np.median(error) < 1e-5, name


def test_a_constant_response_is_h1_with_bendat_and_piersols_error_and_no_bias_by_noise():
    rng = np.random.default_rng(5)
    x = rng.standard_normal(200_000)
    y = (0.5 * x + 0.4 * rng.standard_normal(len(x)))[:, None]
    found = fit(x, y, order=-1)
    # gamma^2 = .25 / (.25 + .16), n_d = 2 Hz * 200 s minus one for the fit
    gamma2 = 0.25 / 0.41
    assert np.median(found.coherence) == pytest.approx(gamma2, rel=0.01)
    assert found.averages[0] == 400 - 1
    assert np.median(found.uncertainty) == pytest.approx(np.sqrt((1 - gamma2) / (2 * gamma2 * 399)), rel=0.02)
    assert np.mean(found.response.real) == pytest.approx(0.5, abs=0.002)
    # the residual is the noise: .4^2 in 500 Hz
    assert np.median(found.noise) == pytest.approx(0.16 / 500, rel=0.01)
    rng = np.random.default_rng(6)
    x = rng.standard_normal(100_000)
    found = fit(x, (2 * x + 5 * rng.standard_normal(len(x)))[:, None])
    assert np.abs(found.response.mean() - 2) < 3 * np.sqrt(2) * 2 * np.median(found.uncertainty) / np.sqrt(250)


def test_records_add_up():
    x = SIGNALS["noise"]
    y = heard(x, noise=1e-3)
    halves = [
        band_sums(x[part, None], y[part], RATE, resolution=1.0, width=2.0)
        for part in (slice(10000), slice(10000, None))
    ]
    both, whole = solve_sums(halves), fit(x, y)
    band = (both.frequency >= 20) & (both.frequency <= 470)
    assert both.averages[0] == pytest.approx(whole.averages[0], abs=4)
    apart = np.abs(both.response[band] / whole.response[band] - 1)
    assert (apart / np.hypot(both.uncertainty, whole.uncertainty)[band]).max() < 5
    # the same recording twice gives the same response, with the uncertainty divided by the root of two
    twice = solve_sums([halves[0], halves[0]])
    once = solve_sums([halves[0]])
    assert twice.response[band] == pytest.approx(once.response[band], rel=1e-9)
    assert np.median(twice.uncertainty[band] / once.uncertainty[band]) == pytest.approx(np.sqrt(0.5), rel=0.1)


def test_an_excluded_channel_and_no_input_have_no_weight():
    x = SIGNALS["noise"]
    sums = band_sums(x[:, None], heard(x), RATE, resolution=1.0, width=2.0)
    only = solve_sums([sums.only(np.arange(16) == 3)])
    assert not only.response[:, np.arange(16) != 3].any()
    assert np.isinf(only.uncertainty[:, 0]).all()
    assert only.response[:, 3] == pytest.approx(solve_sums([sums]).response[:, 3], rel=1e-9)
    y = np.random.default_rng(0).standard_normal((20000, 2))
    found = fit(np.zeros(20000), y)
    assert not found.response.any()
    assert np.isinf(found.uncertainty).all()
    assert found.coherence.max() < 0.5


@pytest.mark.long
@settings(max_examples=6)
@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3))
def test_units_scale_the_response(a, b):
    x = SIGNALS["noise"][:8000]
    y = heard(x, noise=1e-3)[:, :2]
    plain, scaled = fit(x, y), fit(a * x, b * y)
    band = (plain.frequency > 10) & (plain.frequency < 480)
    assert scaled.response[band] == pytest.approx(plain.response[band] * b / a, rel=1e-6)
    assert scaled.uncertainty[band] == pytest.approx(plain.uncertainty[band], rel=1e-4)
    assert scaled.coherence[band] == pytest.approx(plain.coherence[band], abs=1e-6)


def test_few_averages_are_enough_and_widened_by_students_t():
    assert len(fit(np.random.default_rng(0).standard_normal(6000), np.ones((6000, 1))).frequency) > 400
    # t(.975) over 1.95996: 12.706 for one degree of freedom, 4.303 for two, 1.9600 for very many
    assert widened(np.ones(3), np.array([1, 2, 1e7])) == pytest.approx([12.706 / 1.95996, 4.303 / 1.95996, 1], rel=1e-4)


def test_number_of_excited_frequencies():
    # white noise: |X|^2 is exponential, so (sum P)^2 / sum P^2 is half of the 40 frequencies less the 3 of T
    noise = SIGNALS["noise"]
    band = slice(30, 450)
    assert np.median(fit(noise, heard(noise)).excited[band]) == pytest.approx(37 / 2, rel=0.15)
    # a tone is one frequency; the polynomials of T spread it slightly
    tone = np.sin(2 * np.pi * 100.5 * np.arange(20000) / RATE)
    found = fit(tone, heard(tone))
    assert found.excited[np.argmin(np.abs(found.frequency - 100.5)), 0] < 1.5
    assert not fit(np.zeros(20000), heard(tone)).excited.any()


@pytest.mark.long
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


def flat(noise, *, density=None, response=0.02):
    bins = np.zeros((3, 1, 2))
    measured = None
    if density is not None:
        measured = Measurement(
            noise_density=bins + np.reshape(density, (3, 1, 1)),
            **dict.fromkeys(("coherence", "magnitude_uncertainty", "phase_uncertainty"), bins),
            **dict.fromkeys(("noise_uncertainty", "delay", "delay_uncertainty"), bins[0]),
        )
    known = {"sensor": SensorGrid(rows=1, columns=2), "frequency": np.array([0.0, 100.0, 500.0])}
    return Calibration(**known, response=bins + response, noise=bins[0] + noise, measurement=measured)


def test_noise_equivalent_pressure_at_hand_computed_numbers():
    # 20 uV/sqrt(Hz) over 20 mV/Pa in 450 Hz: 1 mPa/sqrt(Hz) * 21.2
    assert noise_equivalent_pressure(flat(20e-6)) == pytest.approx(np.full((1, 2), 1e-3 * np.sqrt(450)))
    # a density that falls from 2 to 0 mPa/sqrt(Hz) over 100 to 500 Hz: sqrt(integral of (2 x/400)^2) = 2 sqrt(400/3)
    slope = flat(0, density=[4e-5, 4e-5, 0])
    assert noise_equivalent_pressure(slope, (100, 500)) == pytest.approx(
        np.full((1, 2), 2e-3 * np.sqrt(400 / 3)), rel=1e-4
    )
    assert np.isinf(noise_equivalent_pressure(flat(1e-6, response=0.0))).all()
