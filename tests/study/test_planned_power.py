"""The power that a plan states is the share of studies in which the report finds the effect."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.study.simulated import simulate

from midair.study.design.session_state import answers_table
from midair.study.design.study_design import PlannedPower
from midair.study.findings import analyse, data_of_answers
from midair.study.findings.rating_findings import adaptive
from midair.study.folder import StudyFolder, read_design, template_text
from midair.study.registration import power_in_words
from midair.study.statistics import f_measure, proportion_correct

STUDIES = 80


@pytest.fixture(scope="module")
def table_of(tmp_path_factory):
    """Return the plan of a template and a complete table of answers, computed once and then modified."""
    made = {}

    def make(template):
        if template not in made:
            path, text = tmp_path_factory.mktemp("p") / "s", template_text(template)
            folder = StudyFolder.create(path, text, read_design(text))
            plan = simulate(folder)
            table = answers_table(plan, folder.sessions())
            made[template] = plan, table.assign(scored=table["scored"] | (table["excluded"] != "n/a"))
        return made[template]

    return make


def told(plan, power):
    return float(re.search(r"power ([\d.]+)", power_in_words(power, plan.design, 400))[1])


def own(plan, test):
    return next(one for one in plan.design.power if one.test == test)


def agrees(found, power):
    """Whether a share of studies agrees with the power within the chance variation of both (99.9 %)."""
    spread = max(power * (1 - power), 0.01)
    return abs(np.mean(found) - power) < 3.3 * np.sqrt(spread / len(found) + spread / 400)


def choices(rng, table, question, d):
    """Answers to a choice by people with individual d'; `d` is given for each row of the table."""
    asked = (table["question"] == question).to_numpy()
    options = sorted(set(table.loc[asked, "right"]))
    right = rng.random(asked.sum()) < proportion_correct(d[asked], alternatives=len(options))
    wrong = [rng.choice([one for one in options if one != known]) for known in table.loc[asked, "right"]]
    answer = table["answer"].to_numpy(object).copy()
    answer[asked] = np.where(right, table.loc[asked, "right"], wrong)
    return table.assign(answer=answer)


def people(table):
    return np.unique(table["participant"], return_inverse=True)[1]


def report(plan, table):
    return {one.title: one for one in analyse(data_of_answers(table, plan.design.analysis), draws=199).findings}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("template", "title", "effect"),
    [
        ("paper", "Identification: plain", None),
        ("paper", "Identification: plain", 0.35),
        ("paired", "Identification: all", None),
        ("paired", "Identification: all", 0.2),
    ],
)
def test_power_of_identification(table_of, template, title, effect):
    plan, table = table_of(template)
    power = own(plan, "identification")
    power = power if effect is None else replace(power, effect=effect)
    rng = np.random.default_rng(1)
    found = []
    for _ in range(STUDIES):
        d = rng.normal(power.effect, 0.3, plan.design.participants)[people(table)]
        words = report(plan, choices(rng, table, plan.design.analysis.choice, d))[title].words
        found.append("better than chance:" in words and "no better" not in words)
    assert agrees(found, told(plan, power)), np.mean(found)


@pytest.mark.slow
@pytest.mark.parametrize("effect", [None, 1.2])
def test_power_of_a_rating_factor(table_of, effect):
    plan, table = table_of("paper")
    power = own(plan, "rating") if effect is None else replace(own(plan, "rating"), effect=effect)
    rated, (who, grooved) = (
        table["question"].str.startswith("like").to_numpy(),
        (people(table), table["surface"] == "grooved"),
    )
    cells = table[["participant", "surface", "object", "rated"]].apply("|".join, axis=1)
    cell = np.unique(cells, return_inverse=True)[1]
    rng = np.random.default_rng(2)
    found = []
    for _ in range(STUDIES):
        # As the plan has it: people differ by 1 step in the mean of each surface over its nine cells.
        y = 4 + rng.normal(0, 0.8, who.max() + 1)[who] + rng.normal(0, 3, cell.max() + 1)[cell] + power.effect * grooved
        answer = table["answer"].to_numpy(object).copy()
        answer[rated] = y[rated]
        effects = report(plan, table.assign(answer=answer))["Ratings: analysis of variance"].table
        assert len(effects) == 7
        found.append(effects.set_index("effect").loc["surface", "p_Holm"] < 0.05)
    assert agrees(found, told(plan, power)), np.mean(found)


@pytest.mark.slow
@pytest.mark.parametrize("test", ["paired", "equivalence"])
def test_power_of_two_conditions(table_of, test):
    plan, table = table_of("paper")
    rng = np.random.default_rng(3)
    means = {"plain": 1.5, "grooved": 0.7 if test == "paired" else 1.5}
    # The effect in the terms of the plan: how macro F of many such people differs.
    f = [
        f_measure(np.stack([rng.multinomial(4, row) for row in shares(mean + rng.normal(0, 0.1))])).mean()
        for _ in range(4000)
        for mean in means.values()
    ]
    apart = np.subtract(f[::2], f[1::2])
    effect = (apart.mean() if test == "paired" else plan.design.analysis.margin) / apart.std()
    power = PlannedPower(test=test, effect=float(effect))
    found = []
    for _ in range(STUDIES):
        d = np.select([table["surface"] == name for name in means], list(means.values()), 0.0)
        d = (
            d
            + rng.normal(0, 0.1, (2, plan.design.participants))[
                (table["surface"] == "plain").astype(int), people(table)
            ]
        )
        words = report(plan, choices(rng, table, "closest", d))["Effect of the condition over people"].words
        p = {"paired": r"t\(\d+\) = [-\d.]+, p ([=<]) ([.\d]+)", "equivalence": r"TOST p ([=<]) ([.\d]+)"}[test]
        found.append(float(re.search(p, words)[2]) < 0.05)
    assert agrees(found, told(plan, power)), (np.mean(found), told(plan, power))


def shares(d):
    right = float(proportion_correct(d, alternatives=3))
    return np.where(np.eye(3) == 1, right, (1 - right) / 2)


@pytest.mark.slow
@pytest.mark.parametrize("template", ["detection", "intervals"])
@pytest.mark.parametrize("effect", [None, 0.6])
def test_power_of_a_threshold(table_of, template, effect):
    from pandas import DataFrame

    plan, table = table_of(template)
    power = own(plan, "threshold") if effect is None else replace(own(plan, "threshold"), effect=effect)
    names, rng, found = sorted(set(table["participant"])), np.random.default_rng(4), []
    for _ in range(STUDIES):
        logs = rng.normal(np.log(10) - power.effect * np.log(2), np.log(2), len(names))
        thresholds = DataFrame(
            {"participant": names, "block": "b", "threshold": np.exp(logs), "strongest": 100.0, "note": ""}
        )
        words = adaptive(data_of_answers(table, plan.design.analysis, thresholds=thresholds))[0].words
        low, high = (float(one) for one in re.search(r"over people ([\d.]+) to ([\d.]+)", words).groups())
        found.append(not low < 10 < high)
    assert agrees(found, told(plan, power)), np.mean(found)
