"""Blind calibration of a sensor: the true response is within twice the stated uncertainty in about 95 % of cases."""

import numpy as np
import pytest

from midair.calibration import MeasureSettings, measure_calibration
from midair.calibration.measure.frequency_response import FrequencyResponse, channel_delay, upper_half
from midair.calibration.measure.referenced_take import noise_signal, sweep_signal
from midair.calibration.measure.take_sums import crosstalk_of
from midair.model import SensorGrid
from midair.physics import SensorModel, channel_response

COARSE = MeasureSettings(resolution=2.0)


def signal(kind, rms, duration, rng):
    return noise_signal(rms, duration, rng=rng) if kind == "noise" else sweep_signal(rms, duration)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["noise", "sweep"])
def test_the_response_of_one_take(kind, bench, covered):
    shares, sure = [], []
    for seed in range(3):
        lab = bench(seed)
        take = lab.take(signal(kind, 10, 20, np.random.default_rng(seed)))
        calibration = measure_calibration([take], quiet=lab.quiet(8))
        shares.append(covered(calibration, lab.model))
        sure.append(np.median(calibration.measurement.magnitude_uncertainty))
        assert calibration.frequency[0] < 20
        assert calibration.frequency[-1] > 470
    # 3 seeds x 16 channels x 450 bins, half of them independent: 95.4 % to .2 %
    magnitude, phase = np.mean(shares, axis=0)
    assert 0.94 < magnitude < 0.965
    assert 0.94 < phase < 0.965
    assert max(sure) < 1e-3


@pytest.mark.long
@pytest.mark.parametrize("kind", ["noise", "sweep"])
def test_the_response_at_any_level(kind, bench, covered):
    for rms in (0.3, 3.0, 30.0):
        shares = []
        for seed in range(20):
            lab = bench(seed)
            take = lab.take(signal(kind, rms, 20, np.random.default_rng(seed)))
            shares.append(covered(measure_calibration([take]), lab.model))
        magnitude, phase = np.mean(shares, axis=0)
        assert 0.94 < magnitude < 0.965, rms
        assert 0.94 < phase < 0.965, rms


@pytest.mark.long
def test_a_reference_with_an_error_within_its_uncertainty(bench, covered):
    """All bins and channels share its error: one number per seed, within the limits for about 95 % of the seeds."""
    inside = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        lab = bench(seed, reference_uncertainty=0.01, reference_error=0.01 * rng.standard_normal())
        calibration = measure_calibration([lab.take(noise_signal(5, 13, rng=rng))], settings=COARSE)
        inside.append(covered(calibration, lab.model)[0] > 0.5)
        assert np.median(calibration.measurement.magnitude_uncertainty) == pytest.approx(0.01, rel=0.01)
    # 95.4 of 100, plus or minus 2.1
    assert 88 <= sum(inside) <= 100


@pytest.mark.long
def test_takes_that_do_not_repeat(bench, covered):
    inside = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        lab = bench(seed, seating=0.01)
        takes = [lab.take(noise_signal(5, 13, rng=rng), number=number) for number in range(4)]
        inside.append(covered(measure_calibration(takes, settings=COARSE), lab.model)[0] > 0.5)
    assert 88 <= sum(inside) <= 100


def test_one_more_seating_increases_the_uncertainty(bench):
    rng = np.random.default_rng(1)
    sure = measure_calibration([bench(1).take(noise_signal(5, 13, rng=rng), number=n) for n in (0, 1)], settings=COARSE)
    lab = bench(1, seating=0.02)
    loose = measure_calibration([lab.take(noise_signal(5, 13, rng=rng), number=n) for n in (0, 1)], settings=COARSE)
    assert np.median(sure.measurement.magnitude_uncertainty) < 1e-3
    assert np.median(loose.measurement.magnitude_uncertainty) > 0.01


def test_delays(bench):
    scores = []
    for seed in range(3):
        lab = bench(seed)
        calibration = measure_calibration([lab.take(noise_signal(10, 13, rng=np.random.default_rng(seed)))])
        frequency, measured = calibration.frequency, calibration.measurement
        upper = upper_half(frequency)
        true = channel_response(lab.model, frequency[upper]).reshape(-1, 16)
        wanted, _ = channel_delay(frequency[upper], true, measured.phase_uncertainty.reshape(-1, 16)[upper])
        scores.append((measured.delay.ravel() - wanted) / measured.delay_uncertainty.ravel())
        # the channels' own delays of 0 to .3 ms, plus the common delay of gel and cavity
        assert wanted - lab.model.delay.ravel() == pytest.approx(np.full(16, 0.27e-3), abs=0.03e-3)
    assert (np.abs(scores) < 2).mean() > 0.9
    assert 0.4 < np.std(scores) < 1.3


@pytest.mark.long
def test_noise(bench, blind_model):
    scores = []
    for seed in range(4):
        lab = bench(seed, model=blind_model(seed, noise=2e-4))
        calibration = measure_calibration(
            [lab.take(noise_signal(5, 13, rng=np.random.default_rng(seed)))], quiet=lab.quiet(13)
        )
        scores.append((calibration.noise / 2e-4 - 1) / calibration.measurement.noise_uncertainty)
    assert (np.abs(scores) < 2).mean() > 0.85
    assert 0.6 < np.std(scores) < 1.5


@pytest.mark.long
def test_crosstalk(bench, blind_model):
    rng = np.random.default_rng(4)
    near = np.abs(np.subtract.outer(np.arange(16), np.arange(16))) == 1
    true = np.eye(16) + 0.05 * near + 0.002 * rng.standard_normal((16, 16))
    np.fill_diagonal(true, 1)
    lab = bench(4, model=blind_model(4, crosstalk=true))
    takes = [lab.take(noise_signal(5, 8, rng=rng), cell=cell) for cell in range(16)]
    found = measure_calibration(takes, settings=COARSE)
    away = ~np.eye(16, dtype=bool)
    score = (found.crosstalk.matrix - true)[away] / found.crosstalk.uncertainty[away]
    assert (np.abs(score) < 2).mean() > 0.93
    assert 0.6 < score.std() < 1.2
    assert np.median(found.crosstalk.uncertainty[away]) < 1e-4


@pytest.mark.long
def test_crosstalk_of_takes_that_do_not_repeat(bench):
    grid = SensorGrid(rows=1, columns=3)
    true = np.array([[1, 0.1, 0.02], [0.12, 1, 0.08], [0.03, 0.09, 1]])
    inside = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        lab = bench(seed, model=SensorModel(grid=grid, crosstalk=true), seating=0.01)
        takes = [
            lab.take(noise_signal(5, 8, rng=rng), cell=cell, number=number) for cell in range(3) for number in range(4)
        ]
        found = measure_calibration(takes, settings=COARSE).crosstalk
        inside.append((np.abs(found.matrix - true) < 2 * found.uncertainty)[~np.eye(3, dtype=bool)])
        assert found.uncertainty.max() < 0.01
    assert 0.9 < np.mean(inside) <= 1


def levels(lab, rng, rms=(2, 5, 10, 20, 40)):
    return [lab.take(noise_signal(level, 8, rng=rng), number=number) for number, level in enumerate(rms)]


@pytest.mark.long
def test_a_straight_sensor_is_straight(bench, covered):
    scores = []
    for seed in range(3):
        lab = bench(seed)
        calibration = measure_calibration(levels(lab, np.random.default_rng(seed)), settings=COARSE)
        line = calibration.linearity
        assert line.levels == 5
        assert line.gain == pytest.approx(np.ones((4, 4)), abs=1e-3)
        scores.append([line.intercept / line.intercept_uncertainty, line.curvature / line.curvature_uncertainty])
        assert line.curvature_uncertainty.max() < 2e-3
        assert covered(calibration, lab.model)[0] > 0.93
    assert (np.abs(scores) < 2).mean() > 0.93


def test_saturation_is_reported_and_increases_the_uncertainty_from_five_levels_on(bench, blind_model, covered):
    lab = bench(2, model=blind_model(2, saturation=2.0))
    calibration = measure_calibration(levels(lab, np.random.default_rng(2)), settings=COARSE)
    line = calibration.linearity
    assert (line.curvature + 4 * line.curvature_uncertainty < 0).all()
    # .8 V rms in an amplifier of 2 V: the small-signal response is still within the limits
    assert np.median(calibration.measurement.magnitude_uncertainty) > 0.02
    assert covered(calibration, lab.model)[0] > 0.85
    takes = levels(bench(0), np.random.default_rng(0), rms=(5, 10, 20, 20.1))
    assert measure_calibration(takes, settings=COARSE).linearity is None


BANDS = 4
ALL = np.ones(BANDS, bool)


def fit(response, relative):
    """Response of two channels to a press on one cell, with the same relative uncertainty everywhere."""
    whole = np.broadcast_to(np.asarray(response, complex), (BANDS, 2))
    known, each = {"frequency": np.arange(BANDS, dtype=float), "averages": np.ones(2)}, np.ones((BANDS, 2))
    known |= dict.fromkeys(("coherence", "noise", "excited"), each)
    return FrequencyResponse(terms=whole[..., None], uncertainty=np.where(whole != 0, relative, np.inf), **known)


def test_each_channel_is_compared_with_its_own_cell():
    # H_ik: channel i, cell k. H_00 = 2, H_10 = .2; H_01 = .5, H_11 = 4j: C_01 = .5 / 2, C_10 = Re(.2 / 4j) = 0
    found = crosstalk_of([fit([2, 0.2], 0.01), fit([0.5, 4j], 0.01)], ALL)
    assert found.matrix == pytest.approx(np.array([[1, 0.25], [0, 1]]))
    # 1 % in H_01 and 1 % in H_00, four bins: .25 * .01 * sqrt(2) / sqrt(4)
    assert found.uncertainty[0, 1] == pytest.approx(0.25 * 0.01 * np.sqrt(2) / 2)
    assert found.uncertainty.diagonal() == pytest.approx([0, 0])
    # Variation between takes adds to both.
    found = crosstalk_of([fit([2, 0.2], 1e-9), fit([0.5, 4], 1e-9)], ALL, repeat=np.array([0.03, 0.04]))
    assert found.uncertainty[0, 1] == pytest.approx(0.25 * 0.05)
    assert found.uncertainty[1, 0] == pytest.approx(0.05 * 0.05)
    dead = crosstalk_of([fit([0, 0.2], 0.01), fit([0, 4], 0.01)], ALL)
    assert dead.matrix == pytest.approx(np.eye(2))
    assert not dead.uncertainty.any()


def test_variation_over_the_band_increases_the_uncertainty_in_the_bins_that_count():
    changing = np.array([[1, 0.1], [1, 0.3], [1, 0.1], [1, 0.3]])
    found = crosstalk_of([fit(changing, 1e-6), fit([0, 1], 1e-6)], ALL)
    # weights go by 1 / (1 + ratio^2) of own and other; nearly even, so mean .2, standard error .1155 / sqrt(4)
    weight = 1 / (np.array([0.1, 0.3, 0.1, 0.3]) ** 2 * 2)
    mean = np.average([0.1, 0.3, 0.1, 0.3], weights=weight)
    scatter = np.average((np.array([0.1, 0.3, 0.1, 0.3]) - mean) ** 2, weights=weight)
    assert found.matrix[1, 0] == pytest.approx(mean)
    assert found.uncertainty[1, 0] == pytest.approx(np.sqrt(scatter / 3), rel=1e-3)
    changing = np.array([[1, 0.1], [1, 9], [1, 0.1], [1, 9]])
    found = crosstalk_of([fit(changing, 0.01), fit([0, 1], 0.01)], np.array([True, False, True, False]))
    assert found.matrix[1, 0] == pytest.approx(0.1)


FREQUENCY = np.arange(100.0, 400.0, 2.0)


def test_a_pure_delay_is_measured_and_noisy_phases_scatter_as_stated():
    response = np.exp(-2j * np.pi * FREQUENCY[:, None] * np.array([0, 1e-4, 3e-3])) * np.array([2, 0.5j, -1])
    delay, unsure = channel_delay(FREQUENCY, response, np.full((150, 3), 0.01))
    assert delay == pytest.approx([0, 1e-4, 3e-3], abs=1e-12)
    # u = .01 / (2 pi sqrt(sum (f - mean)^2)) = .01 / (2 pi 1060.6 Hz)
    assert unsure == pytest.approx(np.full(3, 0.01 / (2 * np.pi * 1060.6)), rel=1e-4)
    rng = np.random.default_rng(0)
    phase = 0.02 * rng.standard_normal((150, 400)) - 2 * np.pi * 5e-4 * FREQUENCY[:, None]
    delay, unsure = channel_delay(FREQUENCY, np.exp(1j * phase), np.full((150, 400), 0.02))
    assert ((delay - 5e-4) / unsure).std() == pytest.approx(1, abs=0.1)
    delay, unsure = channel_delay(FREQUENCY, np.zeros((150, 1)), np.full((150, 1), np.inf))
    assert (delay[0], unsure[0]) == (0, np.inf)
    assert FREQUENCY[upper_half(FREQUENCY)][0] == 250
    assert len(FREQUENCY[:3][upper_half(FREQUENCY[:3])]) == 3
