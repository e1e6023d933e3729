import numpy as np
import pytest

from midair.errors import InputError, ShapeError
from midair.study import Psychometric, fit_psychometric

LEVELS = np.linspace(0.5, 4, 8)


@pytest.mark.parametrize(("shape", "slope"), [("logistic", 3.0), ("normal", 2.0), ("weibull", 3.0)])
def test_fit_finds_the_function(shape, slope):
    rng = np.random.default_rng(0)
    true = Psychometric(threshold=2.0, slope=slope, guess=1 / 3, lapse=0.02, shape=shape)
    total = np.full(8, 400)
    fit = fit_psychometric(
        LEVELS, rng.binomial(total, true.probability(LEVELS)), total, rng=rng, guess=1 / 3, shape=shape, draws=100
    )
    assert fit.function.threshold == pytest.approx(2.0, abs=0.15)
    assert fit.function.slope == pytest.approx(slope, rel=0.3)
    assert fit.threshold_low < 2.0 < fit.threshold_high
    assert fit.deviance_p > 0.01


def test_values_by_hand():
    assert Psychometric(threshold=1, slope=5, guess=0.5).probability(1) == pytest.approx(0.75)
    weibull = Psychometric(threshold=2, slope=3, guess=0.25, lapse=0.05, shape="weibull")
    assert weibull.probability([0, 2]) == pytest.approx([0.25, 0.25 + 0.7 * (1 - np.exp(-1))])


def test_single_trials_are_the_same_data():
    rng = np.random.default_rng(2)
    level = np.repeat(LEVELS, 20)
    right = rng.random(160) < Psychometric(threshold=2, slope=3).probability(level)
    one = fit_psychometric(level, right, np.ones(160), rng=np.random.default_rng(0), draws=10)
    sums = fit_psychometric(
        LEVELS, right.reshape(8, 20).sum(axis=1), np.full(8, 20), rng=np.random.default_rng(0), draws=10
    )
    assert one == sums


def test_says_what_is_wrong():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="three or more"):
        fit_psychometric([1, 2], [1, 2], [3, 3], rng=rng)
    with pytest.raises(InputError, match="no threshold"):
        fit_psychometric([1, 2, 3], [2, 2, 2], [3, 3, 3], rng=rng)
    with pytest.raises(InputError, match="no threshold"):
        fit_psychometric([1, 2, 3], [3, 2, 1], [3, 3, 3], rng=rng)
    with pytest.raises(ShapeError):
        fit_psychometric([1, 2, 3], [3, 2], [3, 3, 3], rng=rng)
    with pytest.raises(InputError, match="shape"):
        Psychometric(threshold=1, slope=1, shape="cubic")
    with pytest.raises(InputError, match="together below 1"):
        Psychometric(threshold=1, slope=1, guess=0.9, lapse=0.2)
