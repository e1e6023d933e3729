import json
import os
import shutil
import sys

import pytest
from tests.study.simulated import simulate

from midair.cli import run as midair
from midair.errors import BrokenFileError, DeviceStateError, FileError, InputError, MismatchError, MissingFileError
from midair.study.folder import StudyFolder, data_of_study, read_design, template_text
from midair.study.session.presenters import SilentPresenter
from midair.study.session.trials import Session
from midair.study.tables import read_bids, read_csv
from midair.study.withdrawal import MADE, log_derived_file, withdraw, withdrawn, write_report


def test_plan_round_trip(tmp_path):
    text = template_text("paper")
    design = read_design(text, name="mine", participants=3, seed=5)
    assert (design.name, design.participants, design.seed) == ("mine", 3, 5)
    folder = StudyFolder.create(tmp_path / "s", text, design)
    assert folder.plan().design == design
    assert (tmp_path / "s" / "plan.toml").read_text(encoding="utf-8") == text
    with pytest.raises(FileError, match="not empty"):
        StudyFolder.create(tmp_path / "s", text, design)


def test_a_plan_that_was_changed_is_refused(tmp_path):
    text = template_text("paper")
    folder = StudyFolder.create(tmp_path / "s", text, read_design(text))
    file = tmp_path / "s" / "plan.json"
    whole = json.loads(file.read_text())
    whole["trials"][0]["stimulus"] = "real_towel" if whole["trials"][0]["stimulus"] != "real_towel" else "real_brush"
    file.write_text(json.dumps(whole))
    with pytest.raises(BrokenFileError, match="changed after it was drawn"):
        folder.plan()
    file.write_text("[]")
    with pytest.raises(BrokenFileError, match="expected a plan"):
        folder.plan()
    file.unlink()
    with pytest.raises(MissingFileError, match="midair study new"):
        folder.plan()


def test_a_log_of_another_person_or_study_or_cut_short_is_reported(tmp_path, capsys):
    text = template_text("paper").replace("repetitions = 4", "repetitions = 1")
    made = []
    for seed in (1, 2):
        folder = StudyFolder.create(tmp_path / str(seed), text, read_design(text, name="s", participants=2, seed=seed))
        simulate(folder)
        made.append(folder)
    folder, other = made
    folder.log(2).write_bytes(b"".join(folder.log(2).read_bytes().splitlines(keepends=True)[:-20]))
    state = folder.sessions()[1].state.removeprefix("not finished, ")
    assert f"Sessions that are not finished: sub-02 ({state})." in data_of_study(folder).notes
    assert midair(["study", "export", f"{folder.path}", f"{tmp_path}/bids"]) == 0
    assert "sub-02: not finished" in capsys.readouterr().err
    rows = [line.split("\t") for line in (tmp_path / "bids" / "participants.tsv").read_text().splitlines()]
    assert [row[rows[0].index("finished")] for row in rows[1:]] == ["true", "false"]
    shutil.copy(folder.log(1), folder.log(2))
    with pytest.raises(MismatchError, match=r"sub-02\.jsonl: expected participant 2, got 1; .* another person"):
        data_of_study(folder)
    shutil.copy(other.log(2), folder.log(2))
    with pytest.raises(MismatchError, match=r"sub-02\.jsonl: expected plan"):
        data_of_study(folder)


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


@pytest.mark.long
def test_withdrawal_keeps_the_bytes_of_other_people(study, tmp_path, capsys):
    (tmp_path / "table.R").write_text("# my own analysis")
    before = everything(tmp_path)
    assert midair(["study", "withdraw", "s", "2", "--force"]) == 0
    said = capsys.readouterr().out
    after = everything(tmp_path)
    assert not [name for name, content in after.items() if b"sub-02" in content or "sub-02" in name]
    gone = {os.path.relpath(name, tmp_path) for name in set(before) - set(after)}
    assert gone == {
        "s/sessions/sub-02.jsonl",
        "bids/sub-02/beh/sub-02_task-s_beh.tsv",
        "bids/sub-02/beh/sub-02_task-s_beh.json",
    }
    assert said.count("made again without the participant") == 3
    changed = {os.path.relpath(name, tmp_path) for name in before if name in after and before[name] != after[name]}
    assert changed == {"bids/participants.tsv", "table.csv", "s/report.html"}
    assert b"2 participants" in after[str(tmp_path / "s" / "report.html")]
    assert set(read_csv(tmp_path / "table.csv")["participant"]) == {"sub-01", "sub-03"}
    assert set(read_bids(tmp_path / "bids")["participant"]) == {"sub-01", "sub-03"}
    kept = [line for line in before[str(tmp_path / "table.csv")].splitlines() if not line.startswith(b"sub-02")]
    assert after[str(tmp_path / "table.csv")].splitlines() == kept


@pytest.mark.long
def test_the_number_stays_unused_and_the_study_continues(study, capsys):
    withdraw(study, 2)
    assert withdrawn(study) == {2}
    assert midair(["study", "run", "s", "--participant", "2", "--array", "virtual"]) == 1
    assert "this one has withdrawn" in capsys.readouterr().err
    assert midair(["study", "run", "s", "--simulate"]) == 0
    assert not study.log(2).exists()
    assert midair(["study", "analyse", "s", "--draws", "20"]) == 0
    assert "2 participants" in capsys.readouterr().out


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
    """The number is recorded first and the log deleted next: an interruption leaves files with the participant."""
    (tmp_path / "s" / "withdrawn.jsonl").write_text(json.dumps({"participant": 2}) + "\n")
    study.log(2).unlink()
    (tmp_path / "bids" / "sub-01" / "notes.txt").write_text("mine")
    assert len(withdraw(study, 2)) == 3
    after = everything(tmp_path)
    assert not [name for name, content in after.items() if "sub-02" in name or b"sub-02" in content]
    assert after[str(tmp_path / "bids" / "sub-01" / "notes.txt")] == b"mine"


def test_without_answers_derived_files_are_deleted_and_not_made_again(study, tmp_path):
    for number in (1, 2, 3):
        told = withdraw(study, number)
    assert sum("deleted, not made again" in line for line in told) == 3
    assert {path.name for path in (tmp_path / "bids").iterdir()} == {
        "README",
        "dataset_description.json",
        "participants.json",
    }
    assert not (tmp_path / "table.csv").exists()
    assert not (study.path / "report.html").exists()


def test_the_folder_of_a_study_may_be_moved_and_a_moved_export_is_named(study, tmp_path):
    write_report(study, study.path / "later.html", draws=5)
    write_report(study, study.path / "later.html", draws=5)
    entry = '{"path": "later.html", "kind": "report", "seed": 0, "draws": 5}'
    assert (study.path / MADE).read_text().splitlines().count(entry) == 1
    moved = StudyFolder(study.path.rename(tmp_path / "moved"))
    before = (moved.path / "later.html").read_bytes()
    (tmp_path / "table.csv").rename(tmp_path / "elsewhere.csv")
    said = "\n".join(withdraw(moved, 2))
    assert f"{moved.path / 'later.html'}: made again" in said
    assert "table.csv: not found; if it was moved, delete the participant" in said
    assert (moved.path / "later.html").read_bytes() != before


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
