import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.study.statistics.test_anova import DESIGNS, HERE

from midair.study import bayes_factor, equivalence, holm, paired_t, pairwise


def test_paired_t_agrees_with_scipy_and_the_paper():
    from scipy.stats import ttest_rel

    a, b = np.random.default_rng(0).normal(size=(2, 9))
    found, theirs = paired_t(a, b), ttest_rel(a, b)
    assert (found.t, found.p, found.df) == pytest.approx((theirs.statistic, theirs.pvalue, 8))
    assert (found.low, found.high) == pytest.approx(tuple(theirs.confidence_interval()))
    assert found.d_z == pytest.approx((a - b).mean() / (a - b).std(ddof=1))
    d = np.array([-1.0, 0, 1])
    d = d + 1.60 / np.sqrt(3)  # standard deviation 1, three objects: t = 1.60
    found = paired_t(d, np.zeros(3))
    assert (found.t, found.df, found.p) == pytest.approx((1.60, 2, 0.2507), abs=5e-5)


# R 4.2.2, BayesFactor 0.9.12: ttest.tstat(t, n, rscale = sqrt(2) / 2)
def test_bayes_factor_equals_r():
    found = [bayes_factor(t, n) for t, n in ((1.6, 3), (2.5, 10), (0.3, 20), (6, 10))]
    assert found == pytest.approx([0.919932039498, 2.37359280415, 0.241966490623, 156.628707386], rel=1e-8)


def test_equivalence_is_two_one_sided_tests():
    from scipy.stats import ttest_1samp

    d = np.random.default_rng(4).normal(0.1, 1, 15)
    found = equivalence(d, np.zeros(15), margin=0.7)
    above = ttest_1samp(d, -0.7, alternative="greater").pvalue
    below = ttest_1samp(d, 0.7, alternative="less").pvalue
    assert found.p == pytest.approx(max(above, below))
    assert (found.p < 0.05) == (found.low > -0.7 and found.high < 0.7)


@given(p=st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_never_lowers_and_keeps_the_order(p):
    found = holm(p)
    assert (found >= np.array(p) - 1e-15).all()
    assert (found <= np.minimum(1, len(p) * np.array(p)) + 1e-12).all()
    order = np.argsort(p, kind="stable")
    assert (np.diff(found[order]) >= 0).all()
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02]), "by hand"


PAIR = ["effect", "first", "second"]


def test_equals_emmeans():
    for name, within in DESIGNS.items():
        reference = pd.read_csv(HERE / f"{name}_pairs_r.csv").set_index(PAIR)
        effects = list(dict.fromkeys(reference.index.get_level_values("effect")))
        how = {"value": "score", "participant": "participant", "within": within, "effects": effects}
        mine = pairwise(pd.read_csv(HERE / f"{name}.csv"), **how).set_index(PAIR)
        assert sorted(mine.index) == sorted(reference.index)
        mine = mine.loc[reference.index]
        for column in ("difference", "low", "high", "df", "t", "p", "d", "p_pairs"):
            close = {"rtol": 1e-8, "atol": 1e-11, "err_msg": f"{name} {column}"}
            np.testing.assert_allclose(mine[column], reference[column], **close)


def test_equal_differences_have_a_note_and_no_number():
    table = {"y": [1.0, 2, 4, 2, 3, 3, 3, 4, 9], "who": list("aaabbbccc"), "x": list("stu" * 3)}
    same = pairwise(table, value="y", participant="who", within=["x"])
    assert "no error" in same["note"][0]
    assert np.isnan([same["t"][0], same["p_pairs"][0]]).all()
    assert same["difference"][0] == -1
    # Holm's correction counts the pairs that have a test.
    assert same["p_pairs"][1:].max() <= 2 * same["p"][1:].max()
