import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.study.statistics.test_anova import DESIGNS, HERE

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.study import bayes_factor, equivalence, holm, paired_t, pairwise
from midair.study.statistics.paired import PairedT


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
    assert found.t == pytest.approx(1.60)
    assert found.df == 2
    assert found.p == pytest.approx(0.2507, abs=5e-5)


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


def test_invalid_pairs_are_refused():
    with pytest.raises(InputError, match="differences that vary, got 0 from all participants"):
        paired_t([1, 2, 3], [1, 2, 3])
    with pytest.raises(ShapeError, match="2 or more"):
        paired_t([1], [2])
    with pytest.raises(NonFiniteError):
        paired_t([1, np.nan], [2, 3])
    with pytest.raises(InputError, match="margin"):
        equivalence([1, 2], [2, 4], margin=0)
    with pytest.raises(NonFiniteError):
        holm([0.1, np.nan])
    with pytest.raises(InputError):
        bayes_factor(np.nan, 5)
    assert isinstance(paired_t([1, 2], [2, 4]), PairedT)


PAIR = ["effect", "first", "second"]


def compare(name, effects=()):
    table = pd.read_csv(HERE / f"{name}.csv")
    return pairwise(table, value="score", participant="participant", within=DESIGNS[name], effects=effects).set_index(
        PAIR
    )


@pytest.mark.parametrize("name", DESIGNS)
def test_equals_emmeans(name):
    reference = pd.read_csv(HERE / f"{name}_pairs_r.csv").set_index(PAIR)
    mine = compare(name, list(dict.fromkeys(reference.index.get_level_values("effect"))))
    assert sorted(mine.index) == sorted(reference.index)
    mine = mine.loc[reference.index]
    for column in ("difference", "low", "high", "df", "t", "p", "d"):
        np.testing.assert_allclose(mine[column], reference[column], rtol=1e-8, atol=1e-11, err_msg=column)
    np.testing.assert_allclose(mine["p_pairs"], reference["p_pairs"], rtol=1e-8, atol=1e-11)


def test_equal_differences_have_a_note_and_no_number():
    table = {"y": [1.0, 2, 4, 2, 3, 3, 3, 4, 9], "who": list("aaabbbccc"), "x": list("stu" * 3)}
    same = pairwise(table, value="y", participant="who", within=["x"])
    assert "no error" in same["note"][0]
    assert np.isnan(same["t"][0])
    assert np.isnan(same["p_pairs"][0])
    assert same["difference"][0] == -1
    # Holm's correction counts the pairs that have a test.
    assert same["p_pairs"][1:].max() <= 2 * same["p"][1:].max()


def test_unknown_effects_are_refused():
    with pytest.raises(InputError, match="factors among surface, object, got site"):
        compare("two_way", ["surface:site"])
    with pytest.raises(InputError, match="no error term"):
        pairwise({"y": [1.0, 2], "who": [0, 0], "x": [0, 1]}, value="y", participant="who", within=["x"])
