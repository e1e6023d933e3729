import numpy as np
import pandas as pd
import pytest

from midair.study.findings.rating_findings import adaptive, psychometric
from midair.study.findings.study_data import StudyData

LEVELS = np.array([0.25, 0.5, 1.0, 2.0, 4.0])


def answers(people, trials, *, threshold=1.0, slope=2.0, guess=0.5, seed=0):
    """Answers with the share 1 - (1 - guess) exp(-(level / threshold)^slope) correct: one Weibull function."""
    rng = np.random.default_rng(seed)
    level = np.tile(np.repeat(LEVELS, trials), people)
    right = rng.random(len(level)) < 1 - (1 - guess) * np.exp(-((level / threshold) ** slope))
    who = np.repeat([f"p{number}" for number in range(people)], trials * len(LEVELS))
    columns = {"participant": who, "level": level, "correct": right.astype(float)}
    return StudyData(strengths=pd.DataFrame({**columns, "guess": np.full(len(level), guess)}).assign(lapse_most=0.05))


def number_after(words, text):
    return float(words.split(text)[1].split()[0].rstrip(",.;"))


def test_a_known_threshold_is_found():
    (found,) = psychometric(answers(8, 60), rng=np.random.default_rng(1))
    # the Weibull function's threshold is where 1 - .5 / e = 82 % are right
    assert number_after(found.words, "Threshold ") == pytest.approx(1.0, abs=0.12)
    low, high = number_after(found.words, "over people "), number_after(found.words.split("over people")[1], " to ")
    assert low < 1.0 < high
    assert "The Weibull function fits the answers" in found.words
    assert found.table["answers"].tolist() == [480] * 5
    assert found.table["share"].tolist() == pytest.approx((found.table["right"] / 480).tolist())


def test_one_person_has_limits_from_trials_only():
    (found,) = psychometric(answers(1, 100), rng=np.random.default_rng(1))
    assert "from trials" in found.words
    assert "over people" not in found.words


def test_a_poor_fit_is_reported():
    data = answers(1, 200)
    wrong = np.where(data.strengths["level"] == 1.0, 0.0, data.strengths["correct"])
    worse = StudyData(strengths=data.strengths.assign(correct=wrong))
    (found,) = psychometric(worse, rng=np.random.default_rng(1))
    assert "does NOT fit" in found.words


def test_thresholds_of_blocks_have_a_geometric_mean():
    table = pd.DataFrame({"participant": ["a", "b", "c"], "block": "x", "threshold": [0.5, 2.0, np.nan]})
    (found,) = adaptive(StudyData(thresholds=table))
    assert found.words.startswith("Geometric mean of 2 thresholds: 1 (no limits with fewer than five people, got 2")
    assert found.table is table


def test_blocks_are_not_people():
    table = pd.DataFrame(
        {"participant": ["a", "b"] * 2, "block": ["x", "x", "y", "y"], "threshold": [0.5, 2.0, 40, 10]}
    )
    (found,) = adaptive(StudyData(thresholds=table))
    assert "Block x: geometric mean of 2 thresholds: 1 (no limits" in found.words
    assert "Block y: geometric mean of 2 thresholds: 20 (no limits" in found.words


def test_blocks_without_any_threshold_keep_their_reasons():
    table = pd.DataFrame({"block": "b", "threshold": np.array([np.nan, np.inf]), "note": ["refused", "no answers"]})
    (found,) = adaptive(StudyData(thresholds=table))
    assert found.words.startswith("No threshold could be estimated. 2 missing: the notes give the reasons.")
    assert found.table is table


def test_no_findings_without_thresholds():
    assert psychometric(StudyData(), rng=np.random.default_rng(0)) == adaptive(StudyData()) == []
