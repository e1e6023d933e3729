import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from midair.study import fit_psychometric
from midair.study.statistics.psychometric import Psychometric, next_level

LEVELS = np.array([1.0, 2, 4, 8, 16, 32])


def test_values_by_hand():
    known = Psychometric(threshold=2, slope=3, guess=0.25, lapse=0.05)
    assert known.probability([0, 2, 4]) == pytest.approx([0.25, 0.6, 0.25 + 0.7 * 8 / 9])


def test_a_fit_finds_the_function():
    for guess in (0.5, 1 / 3, None):
        true = Psychometric(threshold=6.0, slope=2.5, guess=0.15 if guess is None else guess, lapse=0.03)
        levels = LEVELS if guess is not None else np.r_[0, LEVELS]
        total = np.full(len(levels), 2000)
        right = np.rint(total * true.probability(levels))
        fit = fit_psychometric(levels, right, total, rng=np.random.default_rng(0), guess=guess)
        found = fit.function
        made = [found.threshold, found.slope, found.guess, found.lapse]
        assert made == pytest.approx([6, 2.5, true.guess, 0.03], rel=0.02)
        assert fit.low < 6 < fit.high < 1.2 * fit.low
        assert (fit.refusal, fit.ranked) == ("", found.threshold)
        assert fit.p_misfit > 0.5


def test_single_trials_are_the_same_data():
    rng = np.random.default_rng(2)
    level = np.repeat(LEVELS, 20)
    right = rng.random(120) < Psychometric(threshold=5, slope=3, guess=0.5).probability(level)
    sums = right.reshape(6, 20).sum(axis=1)
    one, other = (
        fit_psychometric(*given, rng=np.random.default_rng(0), guess=0.5, draws=10)
        for given in ((level, right, np.ones(120)), (LEVELS, sums, np.full(6, 20)))
    )
    assert one == other


def test_limits_are_those_of_a_logistic_regression():
    """Without guesses and lapses the model is a generalised linear one: its profile limits, by another maximisation."""
    from scipy.optimize import brentq, minimize_scalar
    from scipy.stats import binom, chi2

    right = np.random.default_rng(3).binomial(60, Psychometric(threshold=5.0, slope=1.5).probability(LEVELS))
    fit = fit_psychometric(LEVELS, right, np.full(6, 60), rng=np.random.default_rng(1), lapse_most=0.0, draws=9)

    def height(threshold):
        def loss(slope):
            return -binom.logpmf(right, 60, 1 / (1 + (threshold / LEVELS) ** slope)).sum()

        return minimize_scalar(loss, bounds=(0.5, 10), method="bounded", options={"xatol": 1e-9}).fun

    least = height(fit.function.threshold)
    for limit, ends in ((fit.low, (1, fit.function.threshold)), (fit.high, (fit.function.threshold, 30))):
        assert limit == pytest.approx(brentq(lambda x: 2 * (height(x) - least) - chi2.ppf(0.99, 1), *ends), rel=5e-3)


def test_a_threshold_that_the_answers_do_not_give_is_refused():
    for right, reason, ranked in [
        ([20, 21, 19, 20, 21, 20], "refused: the threshold is above the levels 1 to 32", np.inf),
        ([40] * 6, "refused: the threshold is below the levels", -np.inf),
        ([20, 20, 40, 2, 40, 40], "refused: the model of the answers does not fit", np.nan),
    ]:
        fit = fit_psychometric(LEVELS, right, np.full(6, 40), rng=np.random.default_rng(0), guess=0.5)
        assert fit.refusal.startswith(reason)
        assert fit.ranked == pytest.approx(ranked, nan_ok=True)
    few = fit_psychometric(LEVELS, [1, 1, 1, 1, 2, 2], np.full(6, 2), rng=np.random.default_rng(0), guess=0.5)
    assert "more than a factor of 25" in few.refusal
    assert np.isnan(few.ranked)


def test_quest_goes_to_where_the_threshold_is_uncertain():
    none = np.zeros(6)
    assert LEVELS[next_level(LEVELS, none, none, guess=0.5)] in (4, 8, 16)
    total = np.full(6, 30.0)
    for threshold in (2.0, 16.0):
        right = np.rint(total * Psychometric(threshold=threshold, slope=3, guess=0.5).probability(LEVELS))
        chosen = LEVELS[next_level(LEVELS, right, total, guess=0.5)]
        assert threshold / 2 <= chosen <= 2 * threshold


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "lapse"), [(1.5, 0.0), (3.0, 0.04)])
def test_limits_after_quest_cover(slope, lapse):
    rng, levels, held, shift = np.random.default_rng(7), np.geomspace(1, 100, 13), [], []
    for _ in range(150):
        threshold = np.exp(rng.uniform(np.log(4), np.log(40)))
        true = Psychometric(threshold=threshold, slope=slope, guess=0.5, lapse=lapse)
        right, total = np.zeros((2, 13))
        for _ in range(120):
            index = next_level(levels, right, total, guess=0.5)
            right[index] += rng.random() < true.probability(levels[index])
            total[index] += 1
        right[-1] += rng.binomial(60, true.probability(levels[-1]))
        total[-1] += 60
        seen = total > 0
        fit = fit_psychometric(levels[seen], right[seen], total[seen], rng=rng, guess=0.5, lapse_most=0.15, draws=50)
        held.append(fit.low <= threshold <= fit.high)
        shift.append(np.log(fit.function.threshold / threshold))
    assert np.mean(held) >= 0.87
    assert abs(np.mean(shift)) < 0.15


def test_a_preferred_side_makes_thresholds_too_high_as_the_documentation_states():
    levels, ratios = np.geomspace(1, 100, 13), []
    for bias in (0.5, 1.0):  # the preferred side is chosen in 69 and 84 % of empty trials
        for slope in (1.5, 3):
            z = ndtri(0.5 + 0.5 / (1 + (10 / levels) ** slope))
            right = 4000 * (ndtr(z + bias) + ndtr(z - bias)) / 2
            fit = fit_psychometric(levels, right, [4000] * 13, rng=np.random.default_rng(0), guess=0.5, draws=1)
            ratios.append(fit.function.threshold / 10)
    assert ratios == pytest.approx([1.15, 1.08, 1.71, 1.36], abs=0.05)
