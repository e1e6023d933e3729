from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from midair.errors import InputError
from midair.study.design.study_design import Analysis
from midair.study.findings.analysis import analyse
from midair.study.findings.choice_findings import Finding, attempt, interval_words, note_last, p_words
from midair.study.findings.study_data import data_of_answers, data_of_columns, simulation_of
from midair.study.statistics.confusion import limits_over_people
from midair.study.tables import columns_of, legend_of, read_csv


def test_words_of_p_values_limits_and_failed_analyses():
    assert [p_words(p) for p in (0.0004, 0.05, 1.0)] == ["p < .001", "p = .050", "p = 1.000"]

    def refuse():
        raise InputError("pairs: expected two, got one")

    (found,) = attempt("A test", refuse)
    assert (found.title, found.words) == ("A test", "Not computed. Pairs: expected two, got one.")
    x, people_mean = np.array([1.0, 2, 3, 4, 5]), partial(limits_over_people, np.mean)
    assert interval_words(people_mean, x) == "95 % limits over people 1.04 to 4.96"
    assert "fewer than five" in interval_words(people_mean, x[:4])
    unknown = interval_words(partial(limits_over_people, np.mean, scale="share"), np.ones(5))
    assert "the differences between people are unknown" in unknown
    table = note_last(pd.DataFrame({"note": [""], "F": [1.0], "surface": ["a"]}))
    assert table.columns.tolist() == ["F", "surface", "note"]
    assert [name for name, _ in legend_of(Finding(title="", words="", table=table))] == ["F", "note"]


OBJECTS = ["brush", "sponge", "towel"]


def choices(people=6, skill=0.6, trials=12, seed=0):
    rng = np.random.default_rng(seed)
    n = people * 2 * trials
    right = np.tile(OBJECTS, n // 3)
    return {
        "participant": np.repeat([f"s{i}" for i in range(people)], 2 * trials),
        "surface": np.tile(np.repeat(["plain", "grooved"], trials), people),
        "right": right,
        "answer": np.where(rng.random(n) < skill, right, rng.choice(OBJECTS, n)),
    }


def ratings(people=6, seed=1):
    rng = np.random.default_rng(seed)
    who, surface, thing = np.indices((people, 2, 3)).reshape(3, -1)
    score = np.clip(np.round(4 + (thing == 2) * 1.5 + rng.normal(0, 1, who.size)), 1, 7)
    return {"participant": who, "surface": surface, "object": thing, "score": score}


NAMES = {"participant": "participant", "presented": "right", "answered": "answer", "condition": "surface"}
RATED = {"participant": "participant", "rating": "score", "within": ["surface", "object"]}


def found(report, begin):
    return next(one for one in report.findings if one.title.startswith(begin))


def test_complete_data_give_all_findings_and_every_column_is_explained():
    tables = (choices(), NAMES), (ratings(), RATED)
    report, rated = (analyse(data_of_columns(table, **names), draws=500) for table, names in tables)
    assert [one.title for one in report.findings] == [
        "Participants",
        "Identification: plain",
        "Identification: grooved",
        "Effect of the condition over objects, as in the paper",
        "Effect of the condition over people",
    ]
    plain = found(report, "Identification: plain").words
    assert "better than chance" in plain
    assert "95 % limits over people" in plain
    assert not any("Not computed" in one.words or "nan" in one.words for one in report.findings)
    assert [one.name for one in report.choices] == ["plain", "grooved"]
    assert "Ratings depend on object" in found(rated, "Ratings: analysis").words
    assert len(rated.ratings) == 6
    assert (rated.ratings["low"] < rated.ratings["mean"]).all()
    tables = [one for one in (*report.findings, *rated.findings) if one.table is not None]
    assert len(tables) >= 5
    for one in tables:
        assert {name for name, _ in legend_of(one)} == set(one.table.columns), one.title


def test_conditions_may_be_numbers_random_answers_are_at_chance_and_the_seed_decides():
    table = choices(skill=0, seed=5)
    table |= {"surface": np.where(table["surface"] == "plain", 1.0, 2.0)}
    report, again = (analyse(data_of_columns(table, **NAMES), seed=3, draws=500) for _ in range(2))
    assert "no better than chance" in found(report, "Identification: 1").words
    assert "1.0 and 2.0" in found(report, "Effect of the condition over people").words
    assert [one.words for one in report.findings] == [one.words for one in again.findings]


@pytest.mark.long
def test_pairs_and_ordered_ratings_are_reported():
    report = analyse(data_of_columns(ratings(), **RATED), draws=200)
    pairs = found(report, "Ratings: pairwise")
    assert pairs.table["effect"].tolist()[:4] == ["surface", "object", "object", "object"]
    assert f"of {len(pairs.table)} pairs differ" in pairs.words
    assert {"d", "p_pairs"} <= dict(legend_of(pairs)).keys()


def test_one_participant():
    report = analyse(data_of_columns(choices(people=1), **NAMES), draws=200)
    assert "no tests over people" in found(report, "Participants").words
    assert "Not computed. Pairs: expected two or more people" in found(report, "Effect of the condition").words or any(
        "two or more people" in one.words for one in report.findings
    )
    assert report.choices[0].f_limits is None
    rated = analyse(data_of_columns(ratings(people=1), **RATED), draws=200)
    assert found(rated, "Ratings: analysis").words.startswith("Not computed. Participants: expected two or more")


def test_constant_answers():
    table = choices() | {"answer": np.full(144, "brush")}
    report = analyse(data_of_columns(table, **NAMES), draws=200)
    words = " ".join(one.words for one in report.findings)
    assert "no better than chance" in words
    assert "expected differences that vary, got 0 from all participants" in words
    assert "nan" not in words
    same = ratings() | {"score": np.full(36, 4.0)}
    assert (
        "expected answers that vary, got 4 everywhere"
        in found(analyse(data_of_columns(same, **RATED), draws=200), "Ratings: analysis").words
    )


@pytest.mark.long
def test_people_with_missing_cells_are_left_out():
    table = {name: values[1:] for name, values in ratings().items()}
    report = analyse(data_of_columns(table, **RATED), draws=200)
    words = found(report, "Ratings: analysis").words
    assert "Left out, because cells have no answer: 0 (5 of 6 cells)" in words
    assert "5 people" in words
    without = {name: values[6:] for name, values in ratings().items()}
    same = found(analyse(data_of_columns(without, **RATED), draws=200), "Ratings: analysis")
    pd.testing.assert_frame_equal(found(report, "Ratings: analysis").table, same.table)
    part = {name: values[:12] for name, values in choices().items()}  # one person, one surface
    report = analyse(data_of_columns(part, **NAMES), draws=200)
    assert [one.name for one in report.choices] == ["plain"]


@pytest.mark.long
def test_answers_that_were_never_presented_are_wrong():
    table = choices()
    table = table | {"right": np.where(table["right"] == "towel", "brush", table["right"])}
    foils = int(((table["answer"] == "towel") & (table["surface"] == "plain")).sum())

    wrong = found(analyse(data_of_columns(table, **NAMES), draws=50), "Identification: plain").words
    assert f"{foils} answers name an object that was never presented (towel); they count as wrong" in wrong
    plain = table["surface"] == "plain"
    assert f"of {plain.sum()} answers are correct, among 3 possible ones" in wrong
    right = (table["answer"] == table["right"]) & plain
    assert wrong.startswith(f"{100 * right.sum() / plain.sum():.1f} %")


def test_people_that_the_plan_excludes_are_named_and_trials_without_a_right_answer_are_no_object():
    excluded = pd.DataFrame({"participant": ["c"], "rule": ["attention"], "value": [0.2], "limit": [0.8]})
    table = choices(people=2) | {"right": np.where(np.arange(48) % 12 == 5, "n/a", choices(people=2)["right"])}
    report = analyse(replace(data_of_columns(table, **NAMES), excluded=excluded), draws=50)
    words = found(report, "Participants").words
    assert words.startswith("2 participants, 44 answers analysed")
    assert "The plan excludes c." in words
    assert report.choices[0].confusion.labels == ("brush", "sponge", "towel")


def test_other_questions():
    n = 40
    rng = np.random.default_rng(2)
    right = np.tile(["yes", "no"], n // 2)
    rows = {
        "participant": np.repeat(["a", "b"], n // 2),
        "scored": np.ones(n, bool),
        "simulated": np.zeros(n, bool),
        "question": np.full(n, "felt"),
        "kind": np.full(n, "yes-no"),
        "answer": np.where(rng.random(n) < 0.8, right, "no"),
        "right": right,
        "stimulus": np.full(n, "x"),
    }
    report = analyse(data_of_answers(pd.DataFrame(rows), Analysis()), draws=100)
    assert "d' = " in found(report, "Question felt").words
    size = rows | {
        "kind": np.full(n, "magnitude"),
        "answer": np.tile(["10", "20"], n // 2),
        "stimulus": np.tile(["weak", "strong"], n // 2),
    }
    table = found(analyse(data_of_answers(pd.DataFrame(size), Analysis()), draws=100), "Question felt").table
    assert table["mean"].tolist() == pytest.approx([10, 20])


@pytest.mark.long
def test_few_wrong_answers_are_reported():
    who, thing, _ = np.indices((6, 3, 4)).reshape(3, -1)
    presented = np.array(["a", "b", "c"])[thing]
    answered = presented.copy()
    for wrong, warned in ((5, True), (6, False)):
        answered[::12][:wrong] = "c"
        table = {"participant": who, "presented": presented, "answered": answered}
        data = data_of_columns(table, **{name: name for name in table})
        words = found(analyse(data, draws=20), "Identification").words
        assert f"{100 * (72 - wrong) / 72:.1f} % of 72" in words
        assert ("There are fewer wrong answers than people" in words) == warned


def test_answers_of_people_on_a_simulated_array_are_not_those_of_a_model():
    for marked, by, words in [
        (True, ["model", "model"], "SIMULATED: no person was asked"),
        (True, ["model", "page"], "SIMULATED array: nothing could be felt"),
        (False, ["page", "key"], ""),
    ]:
        assert simulation_of(pd.DataFrame({"simulated": marked, "reaction_by": by})) == words
        alone = pd.DataFrame({"simulated": [marked, marked]})
        assert simulation_of(alone) == (words and "SIMULATED: no person was asked")
        assert simulation_of(pd.DataFrame({"reaction_by": by})) == ""


PSYCHOPY = """\
practice.thisN,trials.thisN,object,surface,keys,slider,participant,
,,,,,,01,
0,,1,low,1,,01,
,0,1,low,1,4,01,
,0,1,low,1,4,01,
,1,2,high,None,,01,
,2,2,high,,3,01,
,,,,,,01,
,0,2,low,2,5,1,
,1,1,high,1,6,S 2,
,1,1,high,1,6,s02,
"""


def test_rows_of_other_programs_that_are_no_trials_are_left_out_and_counted(tmp_path):
    (tmp_path / "a.csv").write_text(PSYCHOPY)
    table = read_csv(tmp_path / "a.csv")
    names = {"participant": "participant", "presented": "object", "answered": "keys", "condition": "surface"}
    data = data_of_columns(table, **names, rating="slider", within=["surface"], where=[("practice.thisN", "")])
    assert data.choices["answered"].tolist() == ["1", "1", "None", "2", "1", "1"]
    assert data.ratings["rating"].tolist() == [4, 4, 3, 5, 6, 6]
    assert data.notes == (
        "1 of 10 rows are left out, since practice.thisN is not empty there.",
        "2 of 9 rows are left out, since object is empty there.",
        "1 of 7 rows are left out, since keys is empty there.",
        "1 of 6 rows equal an earlier row in every column; remove them if they are copies.",
        "'01' and '1' are counted as 2 people; spell each person in one way.",
        "'S 2' and 's02' are counted as 2 people; spell each person in one way.",
        "3 of 9 rows are left out, since slider is empty there.",
    )
    words = found(analyse(data, draws=10), "Participants").words
    assert words.startswith("4 participants, 12 answers analysed. 1 of 10 rows are left out, since practice.thisN")


def test_rows_whose_fields_say_that_there_is_no_value_are_no_trials(tmp_path):
    """Presented null and answered null was an object that everybody recognised."""
    for blank in ("null", "nan", "NaN", "undefined", "None", " ", ""):
        rows = "1,low,low\n1,high,low\n" + f"1,{blank},{blank}\n1,low,{blank}\n"
        (tmp_path / "a.csv").write_text("who,object,answer\n" + rows)
        data = data_of_columns(read_csv(tmp_path / "a.csv"), participant="who", presented="object", answered="answer")
        answers = ["low", "low", *(["None"] if blank == "None" else [])]
        assert data.choices["answered"].tolist() == answers
        left = 4 - len(answers) - (blank != "None")
        assert f"{left} of 4 rows are left out, since object is empty there." in data.notes


def test_usual_columns_of_other_programs_are_found(tmp_path):
    (tmp_path / "a.csv").write_text(PSYCHOPY.replace("keys,slider", "key_resp.keys,slider.response"))
    named = columns_of(read_csv(tmp_path / "a.csv"), "psychopy", {"participant": "participant", "answered": ""})
    assert named == {
        **{"participant": "participant", "presented": "object", "answered": "key_resp.keys"},
        **{"rating": "slider.response", "practice": "practice.thisN"},
    }
    table = pd.DataFrame({name: ["a", "b"] for name in ("rt", "response", "subject", "object", "material")})
    found = columns_of(table, "jspsych", {"participant": "participant", "presented": "material"})
    assert found == {"presented": "material", "participant": "subject", "answered": "response"}
    with pytest.raises(InputError, match=r"expected one column as answered, got a\.keys, b\.keys; name it"):
        columns_of(pd.DataFrame({"a.keys": [1], "b.keys": [1]}), "psychopy", {})


def test_rows_are_selected_by_the_value_of_a_column():
    table = {"p": ["a", "b", "c", "d"], "o": [1.0, 2, 1, 2], "x": [2.0, 1, np.nan, 2], "s": [True, False, True, True]}
    names = {"participant": "p", "presented": "o", "answered": "o"}
    wheres = ("x", "2"), ("x", "2.0"), ("x", "n/a"), ("s", "true"), ("w", "01"), ("w", "")
    wide = table | {"w": ["01", "1", "", "x"]}
    assert [len(data_of_columns(wide, **names, where=[where]).choices) for where in wheres] == [2, 2, 1, 3, 1, 1]
    with pytest.raises(InputError, match="expected rows to analyse, got none: in all 4 rows x is not '7'"):
        data_of_columns(table, **names, where=[("x", "7")])
