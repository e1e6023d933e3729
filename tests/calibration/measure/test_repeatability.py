import numpy as np
import pytest

from midair.calibration.measure.frequency_response import band_sums, solve_sums, widened
from midair.calibration.measure.take_sums import repeatability

RATE = 1000.0


def take(gain, rng, *, noise=0.0, seconds=5):
    """Sums of a take with an individual gain of each channel."""
    x = rng.standard_normal(round(seconds * RATE))
    y = x[:, None] * np.asarray(gain) + noise * rng.standard_normal((len(x), len(gain)))
    return band_sums(x[:, None], y, RATE, resolution=5.0, width=10.0, order=0)


def found(parts):
    whole = solve_sums(parts)
    return repeatability(parts, whole, np.ones(len(whole.frequency), bool))


@pytest.mark.long
def test_the_scatter_of_gains_is_measured():
    rng = np.random.default_rng(0)
    gains = 1 + 0.03 * rng.standard_normal((30, 40))
    magnitude, phase = found([take(gain, rng, noise=0.01) for gain in gains])
    # each take has one thirtieth of the power: .03 / sqrt(30), widened for 29 degrees of freedom
    assert np.sqrt((magnitude**2).mean()) == pytest.approx(widened(0.03 / np.sqrt(30), 29), rel=0.1)
    assert (phase < 0.1 * magnitude).all()


def test_takes_repeat_where_they_differ_by_their_noise_or_there_is_one():
    rng = np.random.default_rng(1)
    parts = [take(np.ones(40), rng, noise=0.3) for _ in range(10)]
    magnitude, _ = found(parts)
    assert np.median(magnitude) < 0.3 * np.median(solve_sums(parts[:1]).uncertainty)
    magnitude, phase = found([take([1.0, 2.0], np.random.default_rng(2), noise=0.1)])
    assert magnitude.tolist() == phase.tolist() == [0, 0]


def test_a_channel_pressed_on_once_among_others_pressed_twice():
    rng = np.random.default_rng(3)
    parts = [take([1.0, 1.0], rng, noise=0.001), take([1.2, 1.2], rng, noise=0.001).only(np.array([True, False]))]
    magnitude, _ = found(parts)
    assert magnitude[0] > 0.05
    assert magnitude[1] == pytest.approx(0, abs=1e-3)
