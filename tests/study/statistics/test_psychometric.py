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


def test_invalid_answers_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="three or more"):
        fit_psychometric([1, 2], [1, 2], [3, 3], rng=rng)
    with pytest.raises(InputError, match="no threshold found"):
        fit_psychometric([1, 2, 3], [2, 2, 2], [3, 3, 3], rng=rng)
    with pytest.raises(InputError, match="no threshold found"):
        fit_psychometric([1, 2, 3], [3, 2, 1], [3, 3, 3], rng=rng)
    with pytest.raises(ShapeError):
        fit_psychometric([1, 2, 3], [3, 2], [3, 3, 3], rng=rng)
    with pytest.raises(InputError, match="shape"):
        Psychometric(threshold=1, slope=1, shape="cubic")
    with pytest.raises(InputError, match="together below 1"):
        Psychometric(threshold=1, slope=1, guess=0.9, lapse=0.2)


@pytest.mark.long
def test_limits_from_many_trials_are_those_of_a_regression():
    sm = pytest.importorskip("statsmodels.api")
    right = np.random.default_rng(3).binomial(500, Psychometric(threshold=2.0, slope=1.5).probability(LEVELS))
    fit = fit_psychometric(LEVELS, right, np.full(8, 500), rng=np.random.default_rng(1), lapse_most=0.0, draws=200)
    glm = sm.GLM(np.c_[right, 500 - right], sm.add_constant(LEVELS), family=sm.families.Binomial()).fit()
    intercept, slope = glm.params
    threshold = -intercept / slope
    gradient = np.array([-1 / slope, intercept / slope**2])
    half = 1.96 * np.sqrt(gradient @ glm.cov_params() @ gradient)
    assert fit.function.threshold == pytest.approx(threshold, abs=1e-3)
    assert [fit.threshold_low, fit.threshold_high] == pytest.approx(
        [threshold - half, threshold + half], abs=0.2 * half
    )


def test_unlimited_thresholds_are_infinite():
    # Right answers begin to rise at the last level only: the threshold may lie anywhere beyond.
    rng = np.random.default_rng(1)
    fit = fit_psychometric(
        LEVELS, [3, 3, 2, 3, 3, 2, 3, 4], np.full(8, 6), rng=rng, guess=0.5, shape="weibull", draws=9
    )
    assert fit.threshold_high == np.inf


@pytest.mark.slow
def test_limits_of_a_threshold_cover():
    # One start for each draw covered .77 to .80.
    true = Psychometric(threshold=1, slope=2.0, guess=0.5, lapse=0.02, shape="weibull")
    levels, each = np.geomspace(0.25, 4, 8), np.full(8, 5)
    rng = np.random.default_rng(7)
    inside = []
    for _ in range(150):
        right = rng.binomial(each, true.probability(levels))
        try:
            fit = fit_psychometric(levels, right, each, rng=rng, guess=0.5, shape="weibull", draws=0)
        except InputError:
            continue
        inside.append(fit.threshold_low <= 1 <= fit.threshold_high)
    # Three standard errors of 150 studies about .95.
    assert 0.895 <= np.mean(inside) <= 0.995
