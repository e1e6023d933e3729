import csv
from pathlib import Path

import numpy as np
import pytest
from pandas import read_csv

from midair.errors import InputError
from midair.study import cumulative_mixed, logistic_mixed, rm_anova
from midair.study.statistics.cumulative import right_answers

WITHIN = ["surface", "object"]


@pytest.fixture
def choices():
    return read_csv(Path(__file__).parent / "mixed" / "choices.csv")


def sizes(name):
    with open(Path(__file__).parent / "mixed" / name, newline="") as file:
        return [{key: text.strip() for key, text in row.items()} for row in csv.DictReader(file)]


def answers_of(trials):
    rows = [row for row in sizes("sizes.csv") if row["trials"] == trials]
    right, total = (np.array([int(row[key]) for row in rows]) for key in ("right", "total"))
    table = {key: np.repeat([row[key] for row in rows], total) for key in ("participant", *WITHIN)}
    correct = np.concatenate([np.arange(n) < k for k, n in zip(right, total, strict=True)])
    return table | {"correct": correct.astype(float)}


@pytest.mark.parametrize(
    "trials", ["48", *(pytest.param(count, marks=pytest.mark.long) for count in ("200", "400", "1000"))]
)
def test_equals_lme4_from_few_trials_to_many(trials):
    # mixed/sizes.R. With quadrature that does not follow the people, 6 x 1000 gave a spread of .76 for 1.07.
    reference = next(row for row in sizes("sizes_r.csv") if row["trials"] == trials and row["model"] == "slopes")
    table = answers_of(trials)
    options = {"correct": "correct", "participant": "participant", "within": WITHIN}
    found = logistic_mixed(table, **options)
    chi2 = [float(reference[key]) for key in ("surface", "object", "both")]
    assert found["chi2"].tolist() == pytest.approx(chi2, rel=1e-3, abs=1e-4)
    spread = right_answers(table, **options).fit().spread
    # lme4 has a level for each person in each surface, object and cell: the same model, of other variances.
    person, surface, thing, both = (
        float(reference[f"sd_{key}"]) ** 2 for key in ("person", "surface", "object", "both")
    )
    level = person + surface / 2 + thing / 3 + both / 6
    same = np.sqrt([level, (3 * surface + both) / 6, (2 * thing + both) / 6, both / 6])
    assert spread.tolist() == pytest.approx(same.tolist(), rel=5e-3, abs=1e-3)
    assert found["spread"].tolist() == pytest.approx((same[1:] * np.sqrt([1, 2, 2])).tolist(), rel=5e-3, abs=1e-3)


def test_differences_between_people_are_no_effect():
    # Five people feel one surface clearly better, and three the other.
    who, surface, trial = np.indices((8, 2, 50)).reshape(3, -1)
    better = np.where(who < 5, surface == 0, surface == 1)
    table = {"correct": (trial < np.where(better, 40, 25)) * 1.0, "who": who, "surface": surface}
    options = {"participant": "who", "within": ["surface"]}
    plain = cumulative_mixed(table, value="correct", slopes=False, **options).iloc[0]
    slopes = logistic_mixed(table, correct="correct", **options).iloc[0]
    assert plain["p"] < 0.05
    assert slopes["p"] > 0.2
    assert slopes["spread"] > 0.5


def test_f_is_that_of_a_linear_model_where_trials_are_many():
    # With many trials a person's logits are all but known: an analysis of variance of them is the same test.
    from scipy.special import expit

    rng = np.random.default_rng(0)
    who, thing, _ = np.indices((7, 2, 1)).reshape(3, -1)
    logit = rng.normal(0, 0.5, (7, 1)) + rng.normal([0.3, -0.3], 0.4, (7, 2))
    right = np.rint(20_000 * expit(logit)).astype(int).ravel()
    repeated = {"who": np.repeat(who, 20_000), "thing": np.repeat(thing, 20_000)}
    correct = np.concatenate([np.arange(20_000) < k for k in right]).astype(float)
    row = logistic_mixed(repeated | {"correct": correct}, correct="correct", participant="who", within=["thing"]).iloc[
        0
    ]
    known = rm_anova({"y": logit.ravel(), "who": who, "thing": thing}, value="y", participant="who", within=["thing"])
    assert row["F"] == pytest.approx(known["F"][0], rel=0.01)
    assert row["p"] == pytest.approx(known["p"][0], rel=0.02)


def test_invalid_tables_are_refused(choices):
    options = {"correct": "correct", "participant": "participant", "within": ["surface"]}
    with pytest.raises(InputError, match="only 1"):
        logistic_mixed(choices.assign(correct=1.0), **options)
    with pytest.raises(InputError, match="expected 0 and 1"):
        logistic_mixed(choices.assign(correct=choices["correct"] + 1), **options)
    with pytest.raises(InputError, match="two or more"):
        logistic_mixed(choices.assign(participant="me"), **options)


@pytest.mark.long
def test_a_cell_with_only_correct_answers_has_a_note(choices):
    correct = np.where(choices["object"] == "brush", 1.0, choices["correct"])
    changed = choices.assign(correct=correct)
    table = logistic_mixed(changed, correct="correct", participant="participant", within=["object"])
    assert np.isfinite(table["p"]).all()
    assert "unreliable" in table["note"][0]


def integral(data, fixed, varying, group, mode):
    """Negative log likelihood of coefficients and log spreads, with 1024 quasi-random draws per person.

    Drawn about each person's mode with that person's curvature, as quadrature is laid, but in any number of dimensions.
    """
    from scipy.special import expit, ndtri
    from scipy.stats import qmc

    z = ndtri(qmc.Sobol(varying.shape[1], seed=1).random(1024))

    def loss(x):
        scaled = varying * np.exp(np.clip(x[fixed.shape[1] :], -7, 4))[group]
        level, total = fixed @ x[: fixed.shape[1]], 0.0
        for who, (right, of) in enumerate(zip(data.right, data.total, strict=True)):
            for _ in range(30):
                p = expit(level + scaled @ mode[who])
                curvature = np.eye(len(mode[who])) + scaled.T @ (scaled * (of * p * (1 - p))[:, None])
                mode[who] += (step := np.linalg.solve(curvature, scaled.T @ (right - of * p) - mode[who]))
                if np.abs(step).max() < 1e-10:
                    break
            root = np.linalg.cholesky(np.linalg.inv(curvature))
            u = mode[who] + z @ root.T
            logit = level + u @ scaled.T
            log = logit @ right - np.logaddexp(0, logit) @ of - (u**2).sum(axis=1) / 2 + (z**2).sum(axis=1) / 2
            total += np.log(np.exp(log - log.max()).mean()) + log.max() + np.log(np.diagonal(root)).sum()
        return -total

    return loss


@pytest.mark.slow
@pytest.mark.parametrize("within", [["object"], WITHIN], ids=["one factor", "two factors"])
@pytest.mark.parametrize("trials", ["48", "200", "400", "1000"])
def test_laplace_is_within_two_percent_of_the_integral(trials, within):
    from scipy.optimize import minimize

    data = right_answers(answers_of(trials), correct="correct", participant="participant", within=within)
    full = data.fit()
    found = []
    for without in range(len(data.names) + 1):
        fit = data.fit(without=without, start=full) if without else full
        kept = (data.effect != without) | (without == 0)
        mode = np.zeros((data.people, len(data.effect)))
        loss = integral(data, data.cells[:, kept], data.cells, data.effect, mode)
        begin = np.r_[-fit.threshold, fit.coefficient, np.log(np.maximum(fit.spread, 0.02))]
        best = minimize(loss, begin, method="L-BFGS-B", options={"maxiter": 40, "ftol": 1e-9})
        found.append((fit.log_likelihood, -best.fun, fit.spread, np.exp(best.x[kept.sum() :])))
    np.testing.assert_allclose(found[0][2], found[0][3], rtol=0.02, atol=0.003)
    for less in found[1:]:
        mine, known = (2 * (found[0][which] - less[which]) for which in (0, 1))
        assert mine == pytest.approx(known, rel=0.02, abs=1e-3)
