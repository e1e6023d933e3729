import numpy as np
import pandas as pd

from midair.study import rm_anova
from midair.study.statistics.columns import cell_means, frame_of, levels, numbers

RATINGS = {"y": [1.0, 2, 3, 4, 6, 5], "who": list("aabbcc"), "x": list("ststst")}
NAMES = {"value": "y", "participant": "who", "within": ["x"]}


def test_a_frame_and_a_dict_are_the_same():
    for kind, table in {
        "frame": pd.DataFrame(RATINGS),
        "with an index of its own": pd.DataFrame(RATINGS, index=[3, 1, 3, 1, 0, 0]),
        "categories": pd.DataFrame(RATINGS).astype({"who": "category", "x": "category", "y": "Int64"}),
        "arrays": {name: np.array(values) for name, values in RATINGS.items()},
        "rows of a larger one": pd.DataFrame({name: [*RATINGS[name], RATINGS[name][0]] for name in RATINGS}).iloc[:6],
    }.items():
        before = pd.DataFrame(table).copy()
        pd.testing.assert_frame_equal(rm_anova(table, **NAMES), rm_anova(RATINGS, **NAMES), obj=kind)
        pd.testing.assert_frame_equal(pd.DataFrame(table), before, obj=kind)


def test_numbers_are_floats_and_levels_are_numbered_in_the_order_of_appearance():
    for values in ([1, 2], ["1", "2.0"], [True, 2], pd.array([1, 2], dtype="Int64")):
        found = numbers(frame_of({"n": values}), "n")
        assert (found.dtype, found.tolist()) == (np.float64, [1.0, 2.0])
    order, number = levels(np.array(["t", "s", "t", "b"]))
    assert (order, number.tolist()) == (["t", "s", "b"], [0, 1, 0, 2])


def test_trials_are_averaged():
    table = {"v": [1.0, 3, 5, 7, 9, 11], "who": list("aaabbb"), "x": list("sstsst")}
    cells = cell_means(table, value="v", participant="who", within=["x"])
    assert (cells.mean.tolist(), (cells.participants, cells.levels)) == ([[2, 5], [8, 11]], (("a", "b"), (("s", "t"),)))
