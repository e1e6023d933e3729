from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from midair.study import rm_anova
from midair.study.statistics.anova import contrasts, effects

HERE = Path(__file__).parent / "anova"
DESIGNS = {  # within-subject factors
    "rm3": ["surface", "presented", "rated"],
    "one_way": ["object"],
    "two_way": ["surface", "object"],
    "levels_2_3_5": ["a", "b", "c"],
    "random_walk": ["day"],
    "five_points": ["strength", "object"],
    "large_effects": ["surface", "object"],
}


def read(name):
    return pd.read_csv(HERE / f"{name}.csv", dtype=str, keep_default_na=False).to_dict("list")


def test_equals_afex():
    for design, within in DESIGNS.items():
        data = read(design)
        data["score"] = np.array(data["score"], float)
        table = rm_anova(data, value="score", participant="participant", within=within)
        reference = read(f"{design}_r")
        assert table["effect"].tolist() == reference["effect"]
        for column in ("df1", "df2", "F", "p", "np2", "ges", "eps_GG", "p_GG", "eps_HF", "p_HF", "W", "p_W"):
            rows = zip(table["effect"], table[column], reference[column], table["df1"], table["p"], strict=True)
            for effect, mine, text, df1, p in rows:
                if text == "NA":  # R leaves out what is 1 by definition
                    assert all(len(set(data[name])) == 2 for name in set(effect.split(":")) & set(within))
                    assert mine == (p if column in ("p_GG", "p_HF") else 1)
                elif column == "p_W" and df1 > 2:  # R's mauchly.test has 3 p for 3 d in Box's second-order term
                    assert mine == pytest.approx(float(text), abs=0.01)
                else:
                    assert mine == pytest.approx(float(text), rel=1e-9), (design, effect, column)


def test_equals_the_textbook():
    # Maxwell and Delaney (2004), tables 12.1, 12.5 and 12.6: reaction times, angle (3) x noise (2), ten people.
    absent = [[420, 420, 480], [420, 480, 480], [480, 480, 540], [420, 540, 540], [540, 660, 540]]
    absent += [[360, 420, 360], [480, 480, 600], [480, 600, 660], [540, 600, 540], [480, 420, 540]]
    present = [[480, 600, 780], [360, 480, 600], [660, 780, 780], [480, 780, 900], [480, 660, 720]]
    present += [[360, 480, 540], [540, 720, 840], [540, 720, 900], [480, 720, 780], [540, 660, 780]]
    rt = np.array([absent, present]).transpose(1, 2, 0)
    person, angle, noise = np.indices(rt.shape).reshape(3, -1)
    frame = pd.DataFrame({"id": person, "angle": angle * 4, "noise": noise, "rt": rt.ravel()})
    table = rm_anova(frame, value="rt", participant="id", within=["angle", "noise"])
    assert (np.round(table["F"], 2).tolist(), table["df1"].tolist()) == ([40.72, 33.77, 45.31], [2, 1, 2])
    assert table["df2"].tolist() == [18, 9, 18]
    sums = np.array([289920, 285660, 105120])
    assert table["np2"].to_numpy() == pytest.approx(sums / (sums + np.array([64080, 76140, 20880])))


def test_one_factor_of_two_levels_is_a_paired_t():
    from scipy.stats import ttest_rel

    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 7))
    table = {"y": np.r_[a, b], "who": [*range(7)] * 2, "x": [0] * 7 + [1] * 7}
    row = rm_anova(table, value="y", participant="who", within=["x"]).iloc[0]
    t = ttest_rel(a, b)
    assert row["F"] == pytest.approx(t.statistic**2)
    assert row["p"] == pytest.approx(t.pvalue)


@pytest.mark.long
@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    scale=st.floats(0.01, 100),
    offset=st.floats(-100, 100),
    shape=st.lists(st.integers(2, 4), min_size=1, max_size=3),
)
def test_units_order_and_a_persons_level_do_not_matter(seed, scale, offset, shape):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(6, *shape))
    where = np.indices(y.shape).reshape(y.ndim, -1)
    names = [f"f{i}" for i in range(len(shape))]

    def table(values, order):
        columns = {"y": values.ravel(), "who": where[0]} | dict(zip(names, where[1:], strict=True))
        return rm_anova({k: v[order] for k, v in columns.items()}, value="y", participant="who", within=names)

    level = rng.normal(size=(6, *[1] * len(shape)))
    plain = table(y, np.arange(y.size))
    other = table(scale * y + offset + level, rng.permutation(y.size))
    for column in ("F", "p", "eps_GG", "eps_HF", "W", "np2"):
        np.testing.assert_allclose(other[column], plain[column], rtol=1e-6, atol=1e-9)


@given(shape=st.lists(st.integers(2, 5), min_size=1, max_size=4))
def test_contrasts_of_all_effects_are_one_orthonormal_basis_less_the_mean(shape):
    rows = np.vstack([contrasts(shape, effect) for effect in effects([str(i) for i in range(len(shape))])])
    assert len(rows) == np.prod(shape) - 1
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-12)
    np.testing.assert_allclose(rows.sum(axis=1), 0, atol=1e-12)


def test_an_effect_without_error_and_too_few_people_for_mauchly_have_notes():
    table = {"y": [1.0, 2, 3, 4, 5, 6], "who": list("aabbcc"), "x": list("ststst")}
    row = rm_anova(table, value="y", participant="who", within=["x"]).iloc[0]
    assert np.isnan(row["F"])
    assert "no error" in row["note"]
    rng = np.random.default_rng(0)
    table = {"y": rng.normal(size=15), "who": np.repeat([0, 1, 2], 5), "x": [*range(5)] * 3}
    row = rm_anova(table, value="y", participant="who", within=["x"]).iloc[0]
    assert np.isnan(row["W"])
    assert "4 or more participants beyond one" in row["note"]
    assert np.isfinite([row["F"], row["p_GG"], row["p_HF"]]).all()
