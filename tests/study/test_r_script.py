"""The R script beside an exported table fits the models that R users know."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from midair.study.folder import read_design
from midair.study.r_script import script_of_plan
from midair.study.tables import write_csv

HERE = Path(__file__).with_name("r")
PLAN = """
name = "r"
participants = 1
seed = 1
stimuli = [{ name = "a", kind = "silence", levels = { object = "a", surface = "s", "in mm" = "1" } }]
[[questions]]
name = "which"
kind = "choice"
text = "Which?"
options = ["brush", "sponge", "towel"]
truth = "object"
[[questions]]
name = "how"
kind = "rating"
text = "How?"
[[blocks]]
name = "b"
stimuli = ["a"]
questions = ["which", "how"]
[analysis]
choice = "which"
condition = "surface"
rated = ["how"]
within = ["surface", "object"]
only = { "in mm" = "1" }
"""


def answers():
    """Correct answers and ratings of made-up people, as an exported table."""
    sizes = pd.read_csv(HERE / "sizes.csv")
    sizes = sizes.loc[sizes.index.repeat(sizes["total"])]
    number = sizes.groupby(["participant", "surface", "object"]).cumcount()
    choices = sizes.assign(question="which", answer="towel", correct=(number < sizes["right"]).astype(int))
    rated = pd.read_csv(HERE / "seven_points.csv", dtype={"score": str})
    rated = rated.assign(question="how", answer=rated["score"], correct=-1)
    names = ["participant", "surface", "object", "question", "answer", "correct"]
    table = pd.concat([choices[names], rated[names]], ignore_index=True).assign(scored=True, block="b")
    return table.assign(**{"in mm": 1})


def test_the_script_names_columns_as_r_does_and_asks_for_what_the_plan_analyses():
    text = script_of_plan(read_design(PLAN), table="a.csv", script="a.R")
    assert "Rscript a.R" in text
    assert 'part <- d[which(d$question == "which" & d$correct >= 0 & d[["in.mm"]] == "1"), ]' in text
    assert 'mixed(part, "correct", c("object", "surface"))' in text
    assert 'mixed(part, "answer", c("surface", "object"))' in text
    assert "threshold(part" not in text


@pytest.mark.long
def test_the_models_are_those_of_r(tmp_path):
    if shutil.which("Rscript") is None:
        pytest.skip("needs R")
    run = {"capture_output": True, "text": True, "check": False, "cwd": tmp_path}
    there = subprocess.run(["Rscript", "-e", "cat(rownames(installed.packages()))"], **run).stdout.split()
    if missing := {"lme4", "ordinal", "afex"} - set(there):
        pytest.skip(f"needs the packages {', '.join(sorted(missing))} of R")
    table = answers()
    write_csv(table, tmp_path / "a.csv")
    (tmp_path / "a.R").write_text(script_of_plan(read_design(PLAN), table="a.csv", script="a.R"))
    done = subprocess.run(["Rscript", str(tmp_path / "a.R")], **run)
    assert done.returncode == 0, done.stderr
    correct, ratings = done.stdout.split("Ratings:")

    def chi2(text, effect):
        return float(re.search(rf"(?m)^ *{effect} +\d+ +(\S+)", text)[1])

    # lme4::glmer and ordinal::clmm called by themselves (R 4.2.2, lme4 1.1-31, ordinal 2022.11-16).
    expected = {"surface": 1.1891400425, "object": 0.933160827, "object:surface": 0.02896777768}
    assert {effect: chi2(correct, effect) for effect in expected} == pytest.approx(expected, abs=2e-4)
    expected = {"surface": 1.2806375, "object": 17.5593541, "surface:object": 0.262390972}
    assert {effect: chi2(ratings, effect) for effect in expected} == pytest.approx(expected, abs=2e-4)
    # The analysis of variance of afex equals midair's.
    from midair.study import rm_anova

    rated = table[table["question"] == "how"]
    rated = rated.assign(y=rated["answer"].astype(float))
    mine = rm_anova(rated, value="y", participant="participant", within=["surface", "object"])
    for row in mine.to_dict("records"):
        shown = re.search(
            rf"(?m)^\d +{row['effect']} +[\d.]+, [\d.]+ +[\d.]+ +([\d.]+)[ *+]+([\d.]+) +([\d.]+)", ratings
        )
        assert [float(one) for one in shown.groups()] == pytest.approx([row["F"], row["ges"], row["np2"]], abs=0.006)
