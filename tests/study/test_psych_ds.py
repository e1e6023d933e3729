"""The Psych-DS dataset of a study, by the rules of the specification."""

import json
import re
from dataclasses import replace

import pandas as pd
import pytest

from midair.errors import FileError, InputError
from midair.study.psych_ds import write_psych_ds

# Rule `Datafile` of the specification's schema.
DATA_FILE = r"([a-z]+-[a-zA-Z0-9]+)(_[a-z]+-[a-zA-Z0-9]+)*_data\.(csv|tsv)"


def test_the_dataset_follows_the_rules_of_the_specification(small_study, tmp_path):
    plan, answers = small_study
    design = replace(plan.design, authors=("A. Person",), license="CC0")
    written = write_psych_ds(answers, design, tmp_path / "p", files="All files are unchanged.")
    description = json.loads((tmp_path / "p" / "dataset_description.json").read_text())
    assert (description["@context"], description["@type"]) == ("https://schema.org/", "Dataset")
    assert description["name"].startswith("SIMULATED: ")
    assert description["description"]
    assert [one["name"] for one in description["author"]] == ["A. Person"]
    data = sorted((tmp_path / "p" / "data").rglob("*.csv"))
    assert [path.name for path in data] == ["study-small_subject-01_data.csv", "study-small_subject-02_data.csv"]
    assert all(re.fullmatch(DATA_FILE, path.name) for path in data)
    tables = [pd.read_csv(path, keep_default_na=False) for path in data]
    # Every column of a data file is in variableMeasured, and every variable is a column.
    variables = [one["name"] for one in description["variableMeasured"]]
    assert all(list(table) == variables for table in tables)
    assert all(one["description"] for one in description["variableMeasured"])
    assert pd.concat(tables)["answer"].astype(str).tolist() == answers["answer"].astype(str).tolist()
    readme = (tmp_path / "p" / "README.md").read_text()
    assert readme.startswith("SIMULATED")
    assert "All files are unchanged." in readme
    assert set(written) == {path for path in (tmp_path / "p").rglob("*") if path.is_file()}
    assert {path.stat().st_mode & 0o077 for path in (tmp_path / "p").rglob("*")} == {0}


def test_datasets_are_not_overwritten_and_not_empty(small_study, tmp_path):
    plan, answers = small_study
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "kept.txt").write_text("kept")
    with pytest.raises(FileError):
        write_psych_ds(answers, plan.design, tmp_path / "p")
    with pytest.raises(InputError, match="expected answers, got none"):
        write_psych_ds(answers.iloc[:0], plan.design, tmp_path / "q")
