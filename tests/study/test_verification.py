import json
import re
import shutil
from pathlib import Path

import pytest
from tests.study.simulated import simulate

import midair.study
from midair.cli.commands.study import study_app
from midair.errors import BrokenFileError, InputError, MismatchError
from midair.study import load_study, noted_seals, verify_study
from midair.study.design import answers_table, digest_of
from midair.study.findings import analyse
from midair.study.folder import StudyFolder, read_design, template_text
from midair.study.session import SimulatedParticipant
from midair.study.verification import data_of_study


def study(*words):
    return study_app([str(word) for word in words], exit_on_error=False, result_action="return_value")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study with three finished simulated participants and drives of arbitrary bytes."""
    path = tmp_path_factory.mktemp("verified")
    short = template_text("paper").replace("repetitions = 4", "repetitions = 1")
    for name, seed in (("s", 1), ("other", 2)):
        (path / "short.toml").write_text(short)
        study(
            "new", path / name, "--source", path / "short.toml", "--drives", "none", "--participants", 3, "--seed", seed
        )
        study("run", path / name, "--simulate")
    return path / "s"


@pytest.fixture
def folder(whole, tmp_path):
    return StudyFolder(shutil.copytree(whole, tmp_path / "s"))


def stripped(path):
    words = re.sub(r', "chain": "[0-9a-f]+"', "", path.read_text())
    path.write_text(words.replace('"answer": "brush"', '"answer": "towel"'))


def without_end(path, lines):
    kept = path.read_bytes().splitlines(keepends=True)[:-lines]
    path.write_bytes(b"".join(kept))


@pytest.mark.long
def test_a_whole_study_has_no_fault_and_its_summary_is_in_report_notebook_and_exports(folder, tmp_path, capsys):
    assert study("verify", folder.path) == 0
    said = capsys.readouterr().out
    summary = said.splitlines()[-1]
    assert [line.split("; ")[1] for line in said.splitlines()[:3]] == ["finished"] * 3
    assert "3 of 3 logs intact; 3 of 3 participants finished" in summary
    assert summary.endswith("no faults.")
    study("analyse", folder.path, "--draws", 20)
    assert summary in capsys.readouterr().out
    assert summary in (folder.path / "report.html").read_text()
    known = {"Path": Path, "study": midair.study}
    exec(load_study(str(folder.path)), known)
    assert analyse(known["data"], draws=20).findings[-1].words == summary
    for kind in ("bids", "csv"):
        study("export", folder.path, tmp_path / kind, "--format", kind)
        assert summary in capsys.readouterr().out
    assert summary in (tmp_path / "bids" / "README").read_text()
    beside = json.loads((tmp_path / "csv.json").read_text())
    assert beside["GeneratedBy"][0]["Description"] == summary
    description = json.loads((tmp_path / "bids" / "dataset_description.json").read_text())
    assert description["GeneratedBy"][0]["Description"] == summary


@pytest.mark.long
def test_a_chain_that_was_removed_is_an_error(folder, tmp_path):
    stripped(folder.log(1))
    for read in (
        folder.sessions,
        lambda: study("analyse", folder.path),
        lambda: study("export", folder.path, tmp_path / "bids"),
        lambda: study("run", folder.path, "--simulate", "--participant", 1),
    ):
        with pytest.raises(BrokenFileError, match=r"sub-01\.jsonl: .* line 1: it has no hash"):
            read()
    found = verify_study(folder)
    assert [line.startswith("FAULT") for line in found.sessions] == [True, False, False]
    assert "2 of 3 logs intact" in found.summary
    assert study("verify", folder.path) == 1


def test_the_plan_cannot_drop_the_chain_alone(folder):
    stripped(folder.log(1))
    file = folder.path / "plan.json"
    plan = json.loads(file.read_text())
    assert plan["chain"] is True
    del plan["chain"]
    file.write_text(json.dumps(plan))
    with pytest.raises(BrokenFileError, match="changed after it was drawn"):
        folder.plan()
    file.write_text(json.dumps(plan | {"digest": digest_of(plan["design"], plan["trials"], plan["drives"])}))
    with pytest.raises(MismatchError, match=r"sub-01\.jsonl: expected plan"):
        folder.sessions()


@pytest.mark.long
@pytest.mark.parametrize(("lines", "state"), [(20, r"\d+ of \d+ trials"), (1, "without an end")])
def test_a_truncated_log_is_reported(folder, tmp_path, capsys, lines, state):
    study("verify", folder.path)
    (tmp_path / "seals.txt").write_text(capsys.readouterr().out)
    without_end(folder.log(2), lines)
    found = verify_study(folder)
    assert list(found.unfinished) == ["sub-02"]
    assert re.search(state, found.unfinished["sub-02"])
    assert "2 of 3 participants finished" in found.summary
    report = {one.title: one.words for one in analyse(data_of_study(folder), draws=20).findings}
    assert re.search(rf"not finished: sub-02 \(.*{state}", report["Check of the files"])
    study("export", folder.path, tmp_path / "bids")
    assert "not finished: sub-02" in capsys.readouterr().out
    rows = [line.split("\t") for line in (tmp_path / "bids" / "participants.tsv").read_text().splitlines()]
    assert [row[rows[0].index("finished")] for row in rows[1:]] == ["true", "false", "true"]
    assert study("verify", folder.path) == 0, "a session may be under way"
    assert study("verify", folder.path, "--seal", tmp_path / "seals.txt") == 1
    assert "its end was removed" in " ".join(capsys.readouterr().out.split())


def test_a_log_of_another_person_or_study_is_reported(folder, whole):
    shutil.copy(folder.log(1), folder.log(2))
    shutil.copy(whole.parent / "other" / "sessions" / "sub-03.jsonl", folder.log(3))
    shutil.copy(folder.log(1), folder.log(9))
    found = verify_study(folder)
    assert found.faults == 3
    assert "sub-02.jsonl: expected participant 2, got 1; the log belongs to another person" in found.sessions[1]
    assert "sub-03.jsonl: expected plan" in found.sessions[2]
    assert "sub-09.jsonl: expected logs of participants 1 to 3" in found.sessions[3]
    with pytest.raises(MismatchError, match=r"sub-02\.jsonl: .* another person"):
        data_of_study(folder)


def test_noted_seals_reveal_a_rewritten_log(folder, whole, tmp_path):
    noted = {f"sub-{n:02d}.jsonl": [verify_study(folder).sessions[n - 1].split("seal ")[1][:32]] for n in (1, 2, 3)}
    assert verify_study(folder, noted=noted).faults == 0
    assert "3 of 3 seals as noted" in verify_study(folder, noted=noted).summary
    text = tmp_path / "seals.txt"
    text.write_text("\n".join(f"Monday, {name}: seal {seal}" for name, (seal,) in noted.items()))
    assert noted_seals(text) == noted
    # An earlier seal is one of the chain hashes, and later lines are counted.
    links = re.findall(r'"chain": "([0-9a-f]{32})"', folder.log(1).read_text())
    earlier = verify_study(folder, noted={"sub-01.jsonl": [links[9]]})
    assert f"as noted, {len(links) - 10} lines since" in earlier.sessions[0]
    folder.log(3).unlink()
    anew = noted | {"sub-02.jsonl": ["0" * 32]}
    lines = verify_study(folder, noted=anew).sessions
    assert [line.startswith("FAULT") for line in lines] == [False, True, True]
    assert "the log was rewritten or its end was removed" in lines[1]
    assert "the file does not exist" in lines[2]
    text.write_text("nothing")
    with pytest.raises(InputError, match="lines such as"):
        noted_seals(text)
    study("withdraw", folder.path, 2, "--force")
    assert verify_study(folder, noted={"sub-02.jsonl": ["0" * 32]}).faults == 0, "withdrawn, and meant to be gone"


def test_a_drive_that_was_changed_is_a_fault(folder):
    (folder.path / "a.drive.h5").write_bytes(b"x")
    file = folder.path / "plan.json"
    plan = json.loads(file.read_text()) | {"drives": {"a.drive.h5": "0" * 64, "gone.drive.h5": "0" * 64}}
    plan["digest"] = digest_of(plan["design"], plan["trials"], plan["drives"], chain=True)
    file.write_text(json.dumps(plan))
    shutil.rmtree(folder.path / "sessions")
    found = verify_study(folder)
    assert "0 of 2 drives as in the plan (changed or missing: a.drive.h5, gone.drive.h5)" in found.summary
    assert found.faults == 2


def test_studies_without_chain_are_read_and_reported(tmp_path):
    shutil.copytree(Path(__file__).parent / "before", tmp_path / "s")
    found = verify_study(StudyFolder(tmp_path / "s"))
    assert found.faults == 0
    assert "the plan is older than chained logs" in found.summary
    assert found.sessions == (
        "sub-01.jsonl: seal none; finished; the plan requires no chain: changes cannot be detected",
    )


PLAN = Path(__file__).with_name("plans").joinpath("visual.toml").read_text(encoding="utf-8")


@pytest.mark.long
def test_sliders_have_the_analysis_of_variance_of_their_unrounded_answers(tmp_path):
    from scipy.stats import ttest_rel

    folder = StudyFolder.create(tmp_path / "s", PLAN, read_design(PLAN))
    plan = simulate(folder, SimulatedParticipant(rating_effect=10, rating_noise=5))
    answers = answers_table(plan, folder.sessions())
    given = answers["answer"].astype(float)
    assert (given % 1).any()
    assert given.between(0, 100).all()
    report = analyse(data_of_study(folder), seed=1, draws=100)
    table = next(one.table for one in report.findings if one.table is not None and "p_GG" in one.table)
    means = given.groupby([answers["participant"], answers["object"]]).mean().unstack()
    # With two levels, F is the square of the paired t.
    assert table.set_index("effect").loc["object", "F"] == pytest.approx(
        ttest_rel(means["towel"], means["glass"]).statistic ** 2
    )
