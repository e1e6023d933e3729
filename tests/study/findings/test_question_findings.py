import re
from dataclasses import replace
from itertools import cycle, product
from typing import get_args

import numpy as np
import pandas as pd
import pytest
from tests.study.simulated import simulate

from midair.errors import InputError
from midair.study import StudyFolder, analyse, answers_table
from midair.study.design.question import Question, QuestionKind, Stimulus
from midair.study.design.study_design import Analysis, Block, Design, Exclusions, Extra
from midair.study.findings.analysis import question_findings
from midair.study.findings.rating_findings import adaptive
from midair.study.findings.study_data import StudyData, data_of_answers
from midair.study.tables import legend_of

KINDS = get_args(QuestionKind)
SHOWN, HIDDEN = ("scored", "scored without truth", "form"), ("unscored", "check", "private", "nowhere")
"""Where a question has findings for each kind of answer, and where no kind has any."""
STIMULI = tuple(Stimulus(name=name, kind="object", source=name, levels={"thing": name}) for name in ("felt", "denim"))


def question(kind, place):
    options = ("felt", "denim") if kind == "choice" else ()
    truth = "thing" if kind == "choice" and place == "scored" else ""
    return Question(name="asked", kind=kind, text="?", options=options, truth=truth, private=place == "private")


def design(kind, place, **analysis):
    which = Question(name="which", kind="choice", text="?", options=("felt", "denim"), truth="thing")
    blocks = [Block(name="a", stimuli=("felt", "denim"), questions=("which",), repetitions=3)]
    if place in ("scored", "scored without truth", "private"):
        blocks = [replace(blocks[0], questions=("which", "asked"))]
    if place == "check":
        blocks = [replace(blocks[0], extras=(Extra(role="attention", stimuli=("felt",), questions=("asked",)),))]
    if place == "unscored":
        blocks.append(Block(name="b", stimuli=("felt",), questions=("asked",), scored=False))
    return Design(
        name="all",
        participants=5,
        seed=1,
        stimuli=STIMULI,
        questions=(which, question(kind, place)),
        blocks=tuple(blocks),
        form=("asked",) if place == "form" else (),
        analysis=Analysis(choice="which", **analysis),
    )


def report(made, folder):
    study = StudyFolder.create(folder / "s", "", made)
    table = answers_table(simulate(study), study.sessions())
    return analyse(data_of_answers(table, made.analysis, design=made), draws=20), table


def test_every_kind_of_question_is_in_the_report_wherever_it_is_asked(tmp_path, subtests):
    for number, (kind, place) in enumerate([*product(KINDS, SHOWN), *zip(KINDS, cycle(HIDDEN), strict=False)]):
        with subtests.test(kind=kind, place=place):
            (folder := tmp_path / str(number)).mkdir()
            found, table = report(design(kind, place), folder)
            parts = {one.title: one for one in found.findings}
            title = "Question asked of the form" if place == "form" else "Question asked"
            assert (title in parts) == (place in SHOWN and kind != "text")
            if part := parts.get(title):
                assert re.search(r"\d", part.words) or len(part.table)
                assert "nan" not in part.words
                assert {name for name, _ in legend_of(part)} == set(() if part.table is None else part.table)
            assert ("asked" in set(table["question"])) == (place not in ("private", "form", "nowhere"))


def test_a_rating_without_an_analysis_has_its_mean_and_spread(tmp_path):
    """A plan with the questions `which` and `rough`, which the report once omitted."""
    found, table = report(design("rating", "scored"), tmp_path)
    part = next(one for one in found.findings if one.title == "Question asked")
    rows = table[table["question"] == "asked"].assign(answer=lambda one: one["answer"].astype(float))
    means = rows.groupby(["stimulus", "participant"])["answer"].mean().unstack()
    assert part.table["stimulus"].tolist() == means.index.tolist()
    assert part.table["mean_rating"].tolist() == pytest.approx(means.mean(axis=1).tolist())
    assert part.table["sd_people"].tolist() == pytest.approx(means.std(axis=1).tolist())
    assert part.table["given"].tolist() == [15, 15]
    assert f"Mean {means.to_numpy().mean():.2f} (95 % limits over people" in part.words
    whole = next(one for one in found.findings if one.title == "Participants")
    assert "60 answers analysed" in whole.words


def test_ratings_and_choices_outside_the_main_comparison_are_reported(tmp_path):
    made = design("rating", "scored", rated=("asked",), within=("thing",), only={"thing": "felt"})
    part = next(one for one in report(made, tmp_path)[0].findings if one.title == "Question asked")
    assert part.table["stimulus"].tolist() == ["denim"]
    made = replace(design("choice", "scored without truth"), analysis=Analysis(choice="asked"))
    parts = {one.title: one.words for one in report(made, tmp_path / "other")[0].findings}
    assert parts["Question asked"].startswith("30 answers; the question has no correct one.")
    assert "correct" in parts["Question which"]


def test_excluded_answers_are_reported_and_one_person_has_a_mean_and_no_spread(tmp_path):
    made = replace(design("rating", "scored"), exclusions=Exclusions(slowest_s=1e-9))
    with pytest.raises(InputError, match="got none among 60; the plan excludes 60 by the rule 'too slow'"):
        report(made, tmp_path)
    found, _ = report(replace(design("slider", "scored"), participants=1), tmp_path / "one")
    part = next(one for one in found.findings if one.title == "Question asked")
    assert np.isnan(part.table["sd_people"]).all()
    assert "no limits with fewer than five people, got 1" in part.words


def test_answers_without_a_correct_one_are_no_false_alarms():
    right = ["yes"] * 60 + ["no"] * 60 + ["n/a"] * 40
    said = ["yes"] * 55 + ["no"] * 5 + ["no"] * 50 + ["yes"] * 10 + ["yes"] * 40
    rows = pd.DataFrame({"participant": "a", "question": "felt", "kind": "yes-no", "stimulus": "x"}, index=range(160))
    (found,) = question_findings(StudyData(others=rows.assign(answer=said, right=right)))
    assert "55 of 60 answered 'yes' when it was correct, 10 of 60 when it was wrong" in found.words


def threshold_words(values, strongest=100.0, block="x"):
    about = {"participant": range(len(values)), "block": block, "method": "quest+", "strongest": strongest}
    table = pd.DataFrame(about | {"threshold": values})
    (found,) = adaptive(StudyData(thresholds=table))
    assert found.table is table
    return found.words


def test_the_median_of_thresholds_counts_people_beyond_the_levels_which_are_named():
    for values, words in [
        ([0.5, 2, np.nan], "Median of 2 thresholds: 1 (no limits with fewer than six people, got 2). 1 missing"),
        ([4, 8, 2, 16, 3, 9], "Median of 6 thresholds: 5.66 (95 % limits over people 2 to 16). Each"),
        ([np.inf, 8, 2, 16, 3, 9], "Median of 6 thresholds: 8.49 (95 % limits over people 2 to above the levels)."),
        ([np.inf] * 4 + [-np.inf, 9], "Median of 6 thresholds: above the levels (95 % limits over people below the"),
        ([40, 50, 60, 70, 80, 90], "Median of 6 thresholds: 64.8 (no limits, since thresholds close to the strongest"),
        ([np.nan] * 2, "No threshold could be estimated. 2 missing: the notes give the reasons."),
    ]:
        assert threshold_words(values).startswith(words)
    words = threshold_words([np.inf, np.inf, 8, 2, 16, -np.inf])
    assert "The median includes people beyond the levels: 2 above and 1 below." in words


def test_limits_of_the_median_hold_where_people_are_beyond_the_levels():
    rng, middle, held = np.random.default_rng(0), [], []
    for _ in range(200):
        values = np.exp(rng.normal(np.log(60), 0.7, 12))
        words = threshold_words(np.where(values > 100, np.inf, values), strongest=500)
        numbers = [float(one.replace("above the levels", "inf")) for one in LIMITS.search(words).groups()]
        middle.append(numbers[0])
        held.append(numbers[1] <= 60 <= numbers[2])
    assert np.median(middle) == pytest.approx(60, rel=0.07)
    assert np.mean(held) > 0.92


LIMITS = re.compile(r"thresholds: (.+?) \(95 % limits over people (.+?) to (.+?)\)\.")


def test_blocks_are_not_people():
    words = threshold_words([0.5, 2.0, 40, 10], 50, ["x", "x", "y", "y"])
    assert "Block x: median of 2 thresholds: 1 (no limits" in words
    assert "Block y: median of 2 thresholds: 20 (no limits" in words
    assert adaptive(StudyData()) == []
