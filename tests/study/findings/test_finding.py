import numpy as np
import pandas as pd
import pytest

from midair.errors import InputError
from midair.study.findings.finding import Finding, attempt, limits_words, note_last, p_words


@pytest.mark.parametrize(("p", "words"), [(0.0004, "p < .001"), (0.05, "p = .050"), (1.0, "p = 1.000")])
def test_format_of_p_values(p, words):
    assert p_words(p) == words


def test_a_failed_analysis_gives_its_reason():
    def refuse():
        raise InputError("pairs: expected two, got one")

    (found,) = attempt("A test", refuse)
    assert (found.title, found.words) == ("A test", "Not computed. Pairs: expected two, got one.")


def test_limits_or_the_reason_why_there_are_none():
    x = np.array([1.0, 2, 3, 4, 5])
    assert limits_words(np.mean, x, "plain") == "95 % limits over people 1.04 to 4.96"
    assert "fewer than five" in limits_words(np.mean, x[:4], "plain")
    assert "the differences between people are unknown" in limits_words(np.mean, np.ones(5), "share")


def test_notes_are_last_and_columns_are_explained():
    table = note_last(pd.DataFrame({"note": [""], "F": [1.0], "surface": ["a"]}))
    assert table.columns.tolist() == ["F", "surface", "note"]
    assert [name for name, _ in Finding(title="", words="", table=table).legend] == ["F", "note"]
