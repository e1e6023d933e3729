import numpy as np
import pandas as pd
import pytest
from tests.study.statistics.test_anova import DESIGNS, HERE

from midair.errors import InputError
from midair.study import pairwise

PAIR = ["effect", "first", "second"]


def compare(name, effects=()):
    within, between = DESIGNS[name]
    table = pd.read_csv(HERE / f"{name}.csv")
    return pairwise(
        table, value="score", participant="participant", within=within, between=between, effects=effects
    ).set_index(PAIR)


@pytest.mark.parametrize("name", DESIGNS)
def test_equals_emmeans(name):
    reference = pd.read_csv(HERE / f"{name}_pairs_r.csv").set_index(PAIR)
    mine = compare(name, list(dict.fromkeys(reference.index.get_level_values("effect"))))
    assert sorted(mine.index) == sorted(reference.index)
    mine = mine.loc[reference.index]
    for column in ("difference", "low", "high", "df", "t", "p", "d"):
        np.testing.assert_allclose(mine[column], reference[column], rtol=1e-8, atol=1e-11, err_msg=column)
    # Tukey's p is an integral; that of R's ptukey has errors of 1e-6.
    np.testing.assert_allclose(mine["p_pairs"], reference["p_pairs"], rtol=1e-5, atol=1e-8)
    # R's pt is inexact above a noncentrality of 37.6, as its documentation states.
    near = (mine["t"].abs() < 20).to_numpy()
    for column in ("d_low", "d_high"):
        np.testing.assert_allclose(mine[column], reference[column], rtol=0.03)
        np.testing.assert_allclose(mine[column][near], reference[column][near], rtol=1e-6, atol=1e-8)


def test_tukey_of_one_measure_is_that_of_scipy():
    from scipy.stats import tukey_hsd

    # scipy has no repeated measures: equal scores under both levels.
    rng = np.random.default_rng(5)
    site = np.repeat(["a", "b", "c"], [4, 6, 9])
    y = rng.normal(size=19) + (site == "c")
    who, x = np.indices((19, 2)).reshape(2, -1)
    found = pairwise(
        {"y": y[who], "who": who, "x": x, "site": site[who]},
        value="y",
        participant="who",
        within=["x"],
        between=["site"],
        effects=["site"],
    )
    judge = tukey_hsd(*(y[site == name] for name in "abc"))
    assert found["p_pairs"].tolist() == pytest.approx([judge.pvalue[0, 1], judge.pvalue[0, 2], judge.pvalue[1, 2]])
    assert set(found["correction"]) == {"Tukey"}


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
