import numpy as np
import pytest

from midair.errors import InputError
from midair.study import bootstrap, sign_flip


def test_sign_flip_by_hand():
    # Three differences of one sign: only all plus and all minus are as large, 2 of 8.
    assert sign_flip(np.array([1.0, 2, 3]), rng=np.random.default_rng(0)) == pytest.approx(0.25)
    assert sign_flip(np.zeros(4), rng=np.random.default_rng(0)) == 1


def test_sign_flip_agrees_with_scipy():
    from scipy.stats import permutation_test

    d = np.random.default_rng(5).normal(0.4, 1, 9)
    exact = permutation_test((d,), np.mean, permutation_type="samples", n_resamples=np.inf)
    assert sign_flip(d, rng=np.random.default_rng(0)) == pytest.approx(exact.pvalue)


def test_random_turns_agree_with_exact_ones():
    rng = np.random.default_rng(1)
    z = rng.normal(0.3, 1, (13, 2))
    exact = sign_flip(z, rng=rng)
    padded = np.vstack([z, np.zeros((1, 2))])  # a fourteenth person without any effect: random turns, the same p
    assert sign_flip(padded, rng=rng, draws=40_000) == pytest.approx(exact, abs=0.01)


def test_bootstrap_agrees_with_scipy():
    import scipy.stats

    x = np.random.default_rng(2).gamma(2, 1, 25)
    mine = bootstrap(np.mean, x, rng=np.random.default_rng(3), draws=4000)
    theirs = scipy.stats.bootstrap((x,), np.mean, n_resamples=4000, method="BCa", rng=np.random.default_rng(4))
    limits = theirs.confidence_interval
    assert float(mine.low) == pytest.approx(limits.low, abs=0.03)
    assert float(mine.high) == pytest.approx(limits.high, abs=0.03)


def test_bootstrap_covers():
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(300):
        found = bootstrap(lambda x: x.mean(axis=0), rng.normal(0, 1, (20, 2)), rng=rng, draws=300)
        inside += int(((found.low < 0) & (found.high > 0)).sum())
    assert 0.88 < inside / 600 < 0.98


def test_constant_figures_have_no_width_and_no_nan():
    found = bootstrap(lambda x: x.mean(axis=0), np.ones((5, 2)), rng=np.random.default_rng(0), draws=50)
    assert found.low.tolist() == found.high.tolist() == [1, 1]


def test_one_person_is_refused():
    with pytest.raises(InputError, match="got 1"):
        bootstrap(np.mean, np.ones(1), rng=np.random.default_rng(0))
    with pytest.raises(InputError, match="got 1"):
        sign_flip(np.ones(1), rng=np.random.default_rng(0))
