"""Stimuli and blocks from a CSV table."""

import pytest

from midair.errors import InputError
from midair.study.design import draw_plan
from midair.study.folder import StudyFolder, read_design

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
