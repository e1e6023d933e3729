import numpy as np
import pytest

from midair.study import f_measure, limits_over_people, sign_flip


def test_sign_flip_by_hand_and_by_scipy():
    from scipy.stats import permutation_test

    # Three differences of one sign: only all plus and all minus are as large, 2 of 8.
    assert sign_flip(np.array([1.0, 2, 3]), rng=np.random.default_rng(0)) == pytest.approx(0.25)
    assert sign_flip(np.zeros(4), rng=np.random.default_rng(0)) == 1
    d = np.random.default_rng(5).normal(0.4, 1, 9)
    exact = permutation_test((d,), np.mean, permutation_type="samples", n_resamples=np.inf)
    assert sign_flip(d, rng=np.random.default_rng(0)) == pytest.approx(exact.pvalue)


def test_random_sign_flips_agree_with_exact_ones():
    rng = np.random.default_rng(1)
    z = rng.normal(0.3, 1, (13, 2))
    exact = sign_flip(z, rng=rng)
    padded = np.vstack([z, np.zeros((1, 2))])  # a fourteenth person without an effect: random sign flips, the same p
    assert sign_flip(padded, rng=rng, draws=40_000) == pytest.approx(exact, abs=0.01)


def test_limits_of_a_mean_are_those_of_student():
    from scipy.stats import t, ttest_1samp

    x = np.random.default_rng(2).gamma(2, 1, 12)
    mine = limits_over_people(np.mean, x)
    theirs = ttest_1samp(x, 0).confidence_interval(0.95)
    assert [float(mine.low), float(mine.high)] == pytest.approx([theirs.low, theirs.high])
    # A share keeps within 0 and 1: to first order t on the logit.
    share = limits_over_people(np.mean, np.array([0.9, 0.95, 1, 0.9, 1, 0.85]), scale="share")
    assert 0.8 < float(share.low) < 0.93 < float(share.high) < 1
    logs = limits_over_people(lambda y: np.exp(np.log(y).mean()), x, scale="positive")
    middle, half = np.log(x).mean(), t.ppf(0.975, 11) * np.log(x).std(ddof=1) / 12**0.5
    assert [float(logs.low), float(logs.high)] == pytest.approx(np.exp([middle - half, middle + half]).tolist())


def test_limits_cover_with_five_people():
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(300):
        found = limits_over_people(lambda x: x.mean(axis=0), rng.normal(0, 1, (5, 2)))
        inside += int(((found.low < 0) & (found.high > 0)).sum())
    assert 0.93 < inside / 600 < 0.97


def test_people_without_differences_have_no_limits():
    for scale in ("plain", "share", "positive"):
        found = limits_over_people(lambda x: x.mean(axis=0), np.ones((5, 2)), scale=scale)
        assert found.value.tolist() == [1, 1]
        assert np.isnan([found.low, found.high]).all()


@pytest.mark.long
def test_limits_of_macro_f_cover():
    # People with individual d' and bias; BCa limits of five people cover .83 to .86.
    def answers(many):
        x = rng.normal(size=(many, 3, 4, 3)) + rng.normal(0, 0.4, (many, 1, 1, 3))
        d = rng.normal(1.2, 0.5, (many, 1))
        for thing in range(3):
            x[:, thing, :, thing] += d
        return (x.argmax(axis=-1)[..., None] == np.arange(3)).sum(axis=2)

    def macro(counts):
        return float(f_measure(counts.sum(axis=0)).mean())

    for people in (5, 10):
        rng = np.random.default_rng(people)
        true = macro(answers(100_000))
        found = [limits_over_people(macro, answers(people), scale="share") for _ in range(1000)]
        assert 0.93 <= np.mean([one.low <= true <= one.high for one in found]) <= 0.97, people
