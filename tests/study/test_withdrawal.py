import json
import os
import shutil
import sys

import pytest
from tests.study.simulated import simulate

from midair.cli import run as midair
from midair.errors import DeviceStateError, FileError, InputError
from midair.study.folder import MADE, StudyFolder, log_derived_file, read_design, template_text, withdraw, withdrawn
from midair.study.session import Session, SilentPresenter
from midair.study.tables import read_bids, read_csv


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A study with three simulated people and a report, with a dataset and a table in other folders."""
    root = tmp_path_factory.mktemp("withdrawal")
    text = template_text("paper").replace("repetitions = 4", "repetitions = 1")
    folder = StudyFolder.create(root / "s", text, read_design(text, name="s", participants=3))
    simulate(folder)
    for line in (f"analyse {root}/s --draws 20", f"export {root}/s {root}/bids"):
        assert midair(["study", *line.split()]) == 0
    assert midair(["study", "export", f"{root}/s", f"{root}/table.csv", "--format", "csv"]) == 0
    assert midair(["study", "export", f"{root}/s", f"{root}/psych", "--format", "psych-ds"]) == 0
    return root


@pytest.fixture
def study(made, tmp_path, monkeypatch):
    """A copy of the study, whose list of derived files has its new path."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    known = tmp_path / "s" / "made.jsonl"
    known.write_text(known.read_text().replace(str(made), str(tmp_path)))
    monkeypatch.chdir(tmp_path)
    return StudyFolder(tmp_path / "s")


def everything(folder):
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_withdrawal_keeps_the_bytes_of_other_people(study, tmp_path, capsys):
    before = everything(tmp_path)
    assert midair(["study", "withdraw", "s", "2", "--force"]) == 0
    said = capsys.readouterr().out
    after = everything(tmp_path)
    assert not [name for name, content in after.items() if b"sub-02" in content or "sub-02" in name]
    gone = {os.path.relpath(name, tmp_path) for name in set(before) - set(after)}
    assert gone == {
        "s/sessions/sub-02.jsonl",
        "s/report.html",
        "s/report.ipynb",
        "bids/sub-02/beh/sub-02_task-s_beh.tsv",
        "bids/sub-02/beh/sub-02_task-s_beh.json",
        "psych/data/sub-02/study-s_subject-02_data.csv",
    }
    assert all(name.split("/")[0] in said or name in said for name in gone)
    assert "report.html: deleted" in " ".join(said.split())
    changed = {os.path.relpath(name, tmp_path) for name in before if name in after and before[name] != after[name]}
    assert changed == {"bids/participants.tsv", "table.csv"}
    assert set(read_csv(tmp_path / "table.csv")["participant"]) == {"sub-01", "sub-03"}
    assert set(read_bids(tmp_path / "bids")["participant"]) == {"sub-01", "sub-03"}
    kept = [line for line in before[str(tmp_path / "table.csv")].splitlines() if not line.startswith(b"sub-02")]
    assert after[str(tmp_path / "table.csv")].splitlines() == kept


@pytest.mark.long  # The report fits the mixed models of a whole study.
def test_the_number_stays_unused_and_the_study_continues(study, capsys):
    withdraw(study, 2)
    assert withdrawn(study) == {2}
    assert midair(["study", "run", "s", "--participant", "2", "--array", "virtual"]) == 1
    assert "this one has withdrawn" in capsys.readouterr().err
    assert midair(["study", "run", "s", "--simulate"]) == 0
    assert not study.log(2).exists()
    assert midair(["study", "analyse", "s", "--draws", "20"]) == 0
    assert "2 participant(s)" in capsys.readouterr().out


def test_unknown_participants_and_unconfirmed_withdrawals_are_refused(study, tmp_path, capsys):
    before = everything(tmp_path)
    with pytest.raises(InputError, match="participant with a log, got 9"):
        withdraw(study, 9)
    assert midair(["study", "withdraw", "s", "2"]) == 1
    assert "use --force to delete without asking" in capsys.readouterr().err
    assert everything(tmp_path) == before


@pytest.mark.skipif(sys.platform == "win32", reason="locks of POSIX")
def test_a_session_that_runs_is_not_deleted(study):
    presenter = SilentPresenter()
    with Session(study.plan(), 2, study.log(2), presenter), pytest.raises(DeviceStateError, match="another program"):
        withdraw(study, 2)
    assert withdrawn(study) == set()


def test_a_second_call_completes_an_interrupted_withdrawal(study, tmp_path):
    """The number is recorded first and the log deleted last: an interruption in between leaves a part of the rest."""
    (tmp_path / "s" / "withdrawn.jsonl").write_text(json.dumps({"participant": 2}) + "\n")
    withdraw(study, 2)
    assert not [name for name in everything(tmp_path) if "sub-02" in name]
    assert withdraw(study, 2)[0].endswith("if it was moved, delete the participant from it by hand")


def test_the_folder_of_a_study_may_be_moved(study, tmp_path):
    report = study.path / "later.html"
    report.write_text("sub-02")
    log_derived_file(study, report, "report")
    log_derived_file(study, report, "report")
    assert (study.path / MADE).read_text().splitlines()[-1] == '{"path": "later.html", "kind": "report"}'
    assert (study.path / MADE).read_text().count("later.html") == 1
    moved = StudyFolder(study.path.rename(tmp_path / "moved"))
    assert f"{moved.path / 'later.html'}: deleted" in "\n".join(withdraw(moved, 2))
    assert not (moved.path / "later.html").exists()


def test_an_export_that_was_moved_is_named(study, tmp_path):
    (tmp_path / "table.csv").rename(tmp_path / "elsewhere.csv")
    said = withdraw(study, 2)
    assert [line for line in said if "table.csv: not found; if it was moved, delete the participant" in line]


def test_a_full_disk_leaves_no_partial_line(tmp_path):
    """A partial line was written without an error, and the study could not be analysed again."""
    resource = pytest.importorskip("resource")
    folder = StudyFolder(tmp_path)
    log_derived_file(folder, tmp_path / "a.html", "report")
    before = (tmp_path / MADE).read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, hard))
    try:
        with pytest.raises(FileError, match=r"made\.jsonl: cannot be written: No space left on device; .* withdrawals"):
            log_derived_file(folder, tmp_path / "b.html", "report")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (tmp_path / MADE).read_bytes() == before
    log_derived_file(folder, tmp_path / "b.html", "report")
    assert len((tmp_path / MADE).read_bytes().splitlines()) == 2
