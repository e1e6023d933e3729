import csv
from pathlib import Path

import numpy as np
import pytest

from midair.errors import InputError
from midair.study import logistic_mixed, logistic_posterior
from midair.study.statistics.mixed import _design, fit_logistic

WITHIN = ["surface", "object"]


@pytest.fixture
def choices():
    with open(Path(__file__).parent / "mixed" / "choices.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return table | {"correct": table["correct"].astype(float)}


def test_equals_lme4(choices):
    # mixed/reference.R: glmer with 25 nodes, likelihood ratios.
    table = logistic_mixed(choices, correct="correct", participant="participant", within=WITHIN)
    assert table["effect"].tolist() == ["surface", "object", "surface:object"]
    assert table["df"].tolist() == [1, 2, 2]
    assert table["chi2"].tolist() == pytest.approx([1.06548834475, 12.3522151121, 1.72448220711], rel=1e-5)
    assert table["p"].tolist() == pytest.approx([0.301966750132, 0.00207850258406, 0.422214794152], rel=1e-5)
    y, person, blocks = _design(choices, "correct", "participant", WITHIN)
    fit = fit_logistic(y, np.hstack(blocks), person)
    assert fit.spread == pytest.approx(0.460044343208, rel=1e-4)
    assert fit.coefficient[0] == pytest.approx(0.787014903593, rel=1e-4)


def test_agrees_with_statsmodels(choices):
    pytest.importorskip("statsmodels")
    posterior = logistic_posterior(choices, correct="correct", participant="participant", within=WITHIN)
    y, person, blocks = _design(choices, "correct", "participant", WITHIN)
    fit = fit_logistic(y, np.hstack(blocks), person)
    assert posterior["term"][0] == "intercept"
    assert (np.abs(posterior["mean"][:-1] - fit.coefficient) < posterior["sd"][:-1] / 2).all()


def test_says_what_is_wrong(choices):
    options = {"correct": "correct", "participant": "participant", "within": ["surface"]}
    with pytest.raises(InputError, match="only 1"):
        logistic_mixed(choices | {"correct": np.ones(len(choices["correct"]))}, **options)
    with pytest.raises(InputError, match="expected 0 and 1"):
        logistic_mixed(choices | {"correct": choices["correct"] + 1}, **options)
    with pytest.raises(InputError, match="two or more"):
        logistic_mixed(choices | {"participant": ["me"] * len(choices["correct"])}, **options)


def test_a_cell_that_is_all_right_is_pointed_at(choices):
    correct = np.where(choices["object"] == "brush", 1.0, choices["correct"])
    changed = choices | {"correct": correct}
    table = logistic_mixed(changed, correct="correct", participant="participant", within=["object"])
    assert np.isfinite(table["p"]).all()
    assert "unsafe" in table["note"][0]
