import json
import re
import shutil
import subprocess

import pandas as pd
import pytest
from tests.study.simulated import simulate

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.study.design.session_state import answers_table
from midair.study.folder import StudyFolder, read_design, template_text
from midair.study.tables import read_bids, read_csv, write_bids, write_csv


def test_bids_round_trip_with_the_required_files(small_study, tmp_path):
    plan, answers = small_study
    written = write_bids(answers, plan.design, tmp_path / "bids")
    assert all(path.exists() for path in written)
    back = read_bids(tmp_path / "bids")
    assert set(back) == set(answers)
    for name in answers:
        assert back[name].tolist() == answers[name].tolist(), name
    description = json.loads((tmp_path / "bids" / "dataset_description.json").read_text())
    assert description["BIDSVersion"]
    assert description["Name"].startswith("SIMULATED")
    assert (tmp_path / "bids" / "README").read_text().startswith("SIMULATED")
    table = tmp_path / "bids" / "sub-01" / "beh" / "sub-01_task-small_beh.tsv"
    sidecar = json.loads(table.with_suffix(".json").read_text())
    names = table.read_text().splitlines()[0].split("\t")
    assert set(names) <= set(sidecar)
    assert sidecar["response_time"]["Units"] == "s"
    people = (tmp_path / "bids" / "participants.tsv").read_text().splitlines()
    assert people[0].split("\t")[0] == "participant_id"
    assert [line.split("\t")[0] for line in people[1:]] == ["sub-01", "sub-02"]


@pytest.fixture(scope="module")
def datasets(small_study, tmp_path_factory):
    """The dataset of the study, and a dataset with two sessions and all optional fields."""
    folder = tmp_path_factory.mktemp("datasets")
    plan, answers = small_study
    write_bids(answers, plan.design, folder / "one")
    text = template_text("paper").replace('group = "grooved"', 'group = "grooved"\nsession = 2').replace("= 4", "= 1")
    stated = 'authors = ["A. Person", "B. Person"]\nlicense = "CC0"\ninstitution = "A University"\nseed = 2020'
    design = read_design(text.replace("seed = 2020", stated, 1), participants=1)
    several = StudyFolder.create(folder / "s", text, design)
    for _ in (1, 2):
        simulate(several)
    write_bids(answers_table(several.plan(), several.sessions()), several.plan().design, folder / "two")
    return folder


def test_sessions_have_folders_of_their_own_without_date_and_pseudonym(datasets):
    found = sorted(path.relative_to(datasets / "two").as_posix() for path in (datasets / "two").rglob("*_beh.tsv"))
    name = "sub-01/ses-{0}/beh/sub-01_ses-{0}_task-paper_beh.tsv"
    assert found == [name.format("01"), name.format("02")]
    back = read_bids(datasets / "two")
    assert (set(back["participant"]), sorted(set(back["session"])), set(back["hand"])) == ({"sub-01"}, [1, 2], {"left"})
    description = json.loads((datasets / "two" / "dataset_description.json").read_text())
    assert (description["Authors"], description["License"]) == (["A. Person", "B. Person"], "CC0")
    words = "".join(path.read_text() for path in (datasets / "two").rglob("*.*") if path.suffix == ".tsv")
    assert "pseudonym" not in words
    assert not re.search(r"20\d\d-\d\d-\d\d", words)


@pytest.mark.parametrize("program", ["bids-validator-deno", "bids-validator"])
def test_the_public_validators_find_no_error(datasets, program):
    if shutil.which(program) is None:
        pytest.skip(f"needs the public {program}")
    for name, warnings in (("one", ["NO_AUTHORS"]), ("two", [])):
        done = subprocess.run([program, str(datasets / name), "--json"], capture_output=True, text=True, check=False)
        issues = json.loads(done.stdout)["issues"]
        if program == "bids-validator":
            assert issues["errors"] == []
            assert [issue["key"] for issue in issues["warnings"]] == warnings
        else:
            assert [issue for issue in issues["issues"] if issue["severity"] == "error"] == []
            assert done.returncode == 0


def test_csv_round_trip(tmp_path):
    table = pd.DataFrame({"who": ["a, b", 'say "x"'], "score": [0.1, 1 / 3], "n": [1, 2], "ok": [True, False]})
    write_csv(table, tmp_path / "t.csv")
    back = read_csv(tmp_path / "t.csv")
    assert {name: back[name].tolist() for name in back} == {name: table[name].tolist() for name in table}
    with pytest.raises(FileError, match="choose another name"):
        write_csv(table, tmp_path / "t.csv")
    # Answers are no formulas to a spreadsheet.
    write_csv(pd.DataFrame({"answer": ["=1+1", "@x", "-3", "towel"], "time": [-1.5, 2, 3, 4]}), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text().splitlines()[1:] == ["'=1+1,-1.5", "'@x,2.0", "-3,3.0", "towel,4.0"]


def test_invalid_tables_and_missing_files_are_refused(small_study, tmp_path):
    plan, answers = small_study
    with pytest.raises(MissingFileError):
        read_csv(tmp_path / "no.csv")
    with pytest.raises(MissingFileError, match="BIDS"):
        read_bids(tmp_path)
    for content, why in [
        (b"a,b\n1\n", "2 fields per line, got 1 in line 2"),
        (b"a,a\n1,2\n", "different names"),
        (b"", "got 0 lines"),
    ]:
        (tmp_path / "t.csv").write_bytes(content)
        with pytest.raises(BrokenFileError, match=why):
            read_csv(tmp_path / "t.csv")
    with pytest.raises(FileError, match="new folder"):
        write_bids(answers, plan.design, tmp_path)
    with pytest.raises(InputError, match="got none"):
        write_bids(answers.iloc[:0], plan.design, tmp_path / "b")
