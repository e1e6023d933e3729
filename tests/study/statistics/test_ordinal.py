import csv
from pathlib import Path

import numpy as np
import pytest

from midair.study import ordinal_check

TWO = {"value": "score", "participant": "participant"}


@pytest.fixture
def ratings():
    with open(Path(__file__).parent / "anova" / "two_way.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return table | {"score": table["score"].astype(float)}


def test_only_the_order_of_each_persons_answers_counts(ratings):
    plain = ordinal_check(ratings, **TWO, within=["surface", "object"], rng=np.random.default_rng(0))
    level = {who: i for i, who in enumerate(np.unique(ratings["participant"]))}
    scale = np.array([1 + level[who] for who in ratings["participant"]])
    bent = np.exp(ratings["score"]) * scale
    other = ordinal_check(ratings | {"score": bent}, **TWO, within=["surface", "object"], rng=np.random.default_rng(0))
    assert other["F"].tolist() == pytest.approx(plain["F"].tolist())
    assert other["p_sign"].tolist() == plain["p_sign"].tolist()
    assert plain["effect"].tolist() == ["surface", "object", "surface:object"]
    assert plain.set_index("effect").loc["object", "p_sign"] < 0.02


def test_two_levels_without_ties_is_a_sign_test():
    table = {"y": [1.0, 2, 3, 5, 2, 7, 1, 8, 4, 6], "who": np.repeat(range(5), 2), "x": [0, 1] * 5}
    row = ordinal_check(table, value="y", participant="who", within=["x"], rng=np.random.default_rng(0)).iloc[0]
    assert row["p_sign"] == pytest.approx(2 / 2**5)
    assert np.isnan(row["F"])  # everyone has the same ranks
