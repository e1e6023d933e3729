import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.study.design import draw_plan
from midair.study.design.session_state import answers_table
from midair.study.folder import StudyFolder, read_design, template_text
from midair.study.session import Session, SilentPresenter, read_events
from midair.study.tables import read_csv, write_csv


def test_plan_round_trip(tmp_path):
    text = template_text("paper")
    design = read_design(text, name="mine", participants=3, seed=5)
    assert (design.name, design.participants, design.seed) == ("mine", 3, 5)
    folder = StudyFolder.create(tmp_path / "s", text, design)
    assert folder.plan().design == design
    assert (tmp_path / "s" / "plan.toml").read_text(encoding="utf-8") == text
    with pytest.raises(FileError, match="not empty"):
        StudyFolder.create(tmp_path / "s", text, design)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("seed = 2020", "sede = 2020", "seed: field required"),
        ("seed = 2020", "seed = 2020\ncolour = 1", "^study: colour: extra inputs are not permitted; correct the TOML$"),
        ("repetitions = 4", "repetitions = 4\ncolour = 1", "study: blocks.0.colour: extra inputs"),
        ("margin = 0.1", "margin = 0.1\ncolour = 1", "study: analysis.colour: extra inputs"),
        ('kind = "choice"', 'kind = "essay"', "questions.1.kind"),
        ("repetitions = 4", "repetitions = 0", "^block 'real': expected .* repetitions of 1 or more"),
        ("participants = 10", "participants = ", "expected TOML"),
        ('truth = "object"', 'truth = "thing"', "^factors: expected .* got 'thing'$"),
    ],
)
def test_invalid_designs_are_refused(old, new, why):
    text = template_text("paper")
    assert old in text
    with pytest.raises(InputError, match=why):
        read_design(text.replace(old, new, 1))


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


def test_studies_of_version_0_1_can_be_continued(tmp_path):
    """Kept as version 0.1.0 of 2026-11-22 wrote it: without links, sides, roles or digests of drives."""
    shutil.copytree(Path(__file__).parent / "before", tmp_path / "s")
    folder = StudyFolder(tmp_path / "s")
    plan = folder.plan()
    then, now = read_csv(tmp_path / "s" / "answers.csv"), answers_table(plan, folder.sessions())
    assert set(then) - set(now) == set()
    write_csv(now, tmp_path / "now.csv")
    again = read_csv(tmp_path / "now.csv")
    assert {name: again[name].tolist() for name in set(then) - {"time"}} == {
        name: then[name].tolist() for name in set(then) - {"time"}
    }
    assert (np.diff(now["time"]) > 0).all()
    with Session(plan, 1, folder.log(1), SilentPresenter(), simulated=True) as session:
        assert session.step.kind == "done"
    assert read_events(folder.log(1))[-1]["event"] == "done"
    folder.log(1).write_bytes(folder.log(1).read_bytes().replace(b'"towel"', b'"brush"', 1))
    with pytest.raises(BrokenFileError, match="chain"):
        folder.sessions()


TOML = """
name = "table"
participants = 1
seed = 1
form = ["hand"]
[[questions]]
name = "hand"
kind = "choice"
text = "Which hand?"
options = ["left", "right"]
[[questions]]
name = "rough"
kind = "slider"
text = "How rough?"
[[blocks]]
name = "low"
questions = ["rough"]
order = "fixed"
"""

TABLE = """block,stimulus,kind,source,object,code
low,brush,object,a soft brush,brush,
low,nothing,silence,,,7
low,brush,object,a soft brush,brush,
high,brush,object,a soft brush,brush,
"""


def test_the_rows_are_the_trials_in_their_order():
    design = read_design(TOML.replace("[[blocks]]", "[[blocks]]\nstimuli = []"), trials=TABLE)
    trials = draw_plan(design).trials
    assert [(trial.block, trial.stimulus) for trial in trials] == [
        ("low", "brush"),
        ("low", "nothing"),
        ("low", "brush"),
        ("high", "brush"),
    ]
    assert [trial.repetition for trial in trials] == [1, 1, 2, 1]
    assert {trial.questions for trial in trials} == {("rough",)}
    assert design.factors == ("object",)
    assert (design.stimulus("brush").source, design.stimulus("nothing").code) == ("a soft brush", 7)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_tables_of_spreadsheets_are_read(separator):
    table = "\ufeff" + TABLE.replace(",", separator).replace("\n", "\r\n")
    assert read_design(TOML, trials=table) == read_design(TOML, trials=TABLE)


def test_the_table_is_stored_and_gives_the_same_plan_again(tmp_path):
    folder = StudyFolder.create(tmp_path / "s", TOML, read_design(TOML, trials=TABLE), trials=TABLE)
    stored = (folder.path / "trials.csv").read_text()
    again = read_design((folder.path / "plan.toml").read_text(), trials=stored)
    assert draw_plan(again).digest == folder.plan().digest


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",stimulus,", ",name,", "with the column stimulus"),
        (
            "low,nothing,silence",
            "low,nothing,smell",
            "row 3, column kind: expected one of drive, object, silence, text",
        ),
        ("a soft brush", "", "row 2, column source: expected the source of the object, got"),
        (",,,7", ",,,seven", "row 3, column code: expected a whole number, got 'seven'"),
        (
            "high,brush,object,a soft",
            "high,brush,object,a hard",
            "row 5, column source: expected 'a soft brush' as in row 2",
        ),
        ("low,nothing", "low,", "row 3, column stimulus: expected the name of a stimulus"),
        (",,,7", ",,,7,8", "row 3: expected 6 fields, got 7"),
        (",,,7", ",,,3", "expected code 2 or 5 to 255"),
    ],
)
def test_errors_state_row_and_column(old, new, message):
    with pytest.raises(InputError, match=message):
        read_design(TOML, trials=TABLE.replace(old, new))


def test_a_stimulus_or_block_is_described_once():
    stated = TOML + '[[stimuli]]\nname = "brush"\nkind = "object"\nsource = "a brush"\n'
    with pytest.raises(InputError, match="row 2, column kind: expected an empty field, since the TOML states"):
        read_design(stated, trials=TABLE)
    with pytest.raises(InputError, match="expected block 'low' without stimuli in the TOML"):
        read_design(TOML + 'stimuli = ["brush"]', trials=TABLE)
    with pytest.raises(InputError, match="with names; correct the TOML"):
        read_design(TOML.replace('name = "rough"', ""), trials=TABLE)
