import io
import json
import re
import shlex

import numpy as np
import pytest
from tests.drives import log, save_drive
from tests.palms import palm_path

from midair.cli.commands.study import study_app as app
from midair.errors import BrokenFileError, InputError, MidairError
from midair.files import save_palm_path
from midair.model import Provenance, TransducerArray
from midair.physics import focus_phase
from midair.settings import Settings
from midair.study import template_text
from midair.study.folder import StudyFolder
from midair.study.session.event_log import read_events
from midair.study.tables import read_csv, write_csv


def study(*words):
    return app([str(word) for word in words], exit_on_error=False, result_action="return_value")


@pytest.fixture
def typed(monkeypatch):
    """Type lines in a terminal."""
    return lambda lines: monkeypatch.setattr("sys.stdin", io.StringIO(lines))


@pytest.fixture(autouse=True)
def _state(monkeypatch, tmp_path):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A study of ten simulated participants through new and run."""
    folder = tmp_path_factory.mktemp("cli") / "touch"
    study("new", folder, "--seed", 1, "--drives", "none")
    assert study("run", folder, "--simulate") == 0
    return folder


@pytest.mark.long
def test_ten_simulated_participants_from_plan_to_report(done, capsys):
    study("analyse", done, "--draws", 200, "--json")
    found = json.loads(capsys.readouterr().out)
    assert found["simulated"] is True
    anova = next(one for one in found["findings"] if one["title"] == "Ratings: analysis of variance")
    assert len(anova["table"]) == 7
    assert {"effect", "F", "p_GG", "ges"} <= set(anova["table"][0])
    page = (done / "report.html").read_text(encoding="utf-8")
    assert "SIMULATED: no person was asked. 10 participants, 1080 answers analysed, 240" in page
    assert "Identification: plain" in page
    assert page.count("data:image/png;base64,") == 6  # three matrices, F-measures, ratings of two surfaces
    assert "surface:object:rated" in page
    assert "Not computed" not in page
    assert "nan" not in page.lower().split("base64")[0]


@pytest.mark.long
def test_ratings_of_a_plan_and_of_its_table_have_the_same_analysis(tmp_path, capsys):
    text = template_text("paper").replace("repetitions = 4", "repetitions = 1").replace("pants = 10", "pants = 6")
    (tmp_path / "p.toml").write_text(text.replace("margin = 0.1", 'margin = 0.1\nbetween = ["hand"]'))
    study("new", "s", "--source", "p.toml", "--drives", "none")
    study("run", "s", "--simulate")
    capsys.readouterr()
    study("analyse", "s", "--draws", 20, "--json")
    findings = {one["title"]: one for one in json.loads(capsys.readouterr().out)["findings"]}
    mine = findings["Ratings: analysis of variance"]["table"]
    assert ([row["effect"] for row in mine][:3], len(mine)) == (["surface", "object", "rated"], 7)
    assert (mine[0]["df1"], mine[0]["df2"]) == (1, 5)
    assert (
        "Factors between people (hand) are tested by the R script" in findings["Ratings: analysis of variance"]["words"]
    )
    # The same from a table by the names of its columns.
    study("export", "s", "a.csv", "--format", "csv")
    table = read_csv(tmp_path / "a.csv")
    write_csv(table[table["question"].str.startswith("like") & table["scored"]], tmp_path / "r.csv")
    capsys.readouterr()
    columns = ["--rating", "answer", "--within", "surface", "object", "rated"]
    study("analyse", "r.csv", *columns, "--draws", 20, "--json")
    findings = {one["title"]: one for one in json.loads(capsys.readouterr().out)["findings"]}
    assert findings["Ratings: analysis of variance"]["table"] == mine


def test_a_script_of_another_export_is_kept(done, tmp_path):
    (tmp_path / "mine.R").write_text("# by hand", encoding="utf-8")
    with pytest.raises(MidairError, match=r"mine\.R: expected a new file beside mine\.csv"):
        study("export", done, tmp_path / "mine.csv", "--format", "csv")
    assert [each.name for each in tmp_path.iterdir() if each.suffix] == ["mine.R"]
    assert (tmp_path / "mine.R").read_text(encoding="utf-8") == "# by hand"


@pytest.mark.long
def test_export_and_old_data_give_the_same_figures(done, tmp_path, capsys):
    study("export", done, tmp_path / "bids")
    study("export", done, tmp_path / "answers.csv", "--format", "csv")
    names = ["--presented", "right", "--answered", "answer", "--condition", "surface", "--draws", "200", "--json"]
    rows = ["--where", "question=closest", "scored=true", "presentation=reproduced"]
    found = []
    capsys.readouterr()
    for source in (tmp_path / "bids", tmp_path / "answers.csv"):
        with pytest.raises(InputError):
            study("analyse", source)
        study("analyse", source, *names, *rows)
        found.append(json.loads(capsys.readouterr().out))
    study("analyse", done, "--draws", 200, "--json")
    found.append(json.loads(capsys.readouterr().out))
    for title in ("Identification: plain", "Identification: grooved"):
        tables = [next(one["table"] for one in each["findings"] if one["title"] == title) for each in found]
        key = [[(row["object"], row["presented"], row["answered"], row["F"]) for row in table] for table in tables]
        assert key[0] == key[1] == key[2]


def test_rows_are_selected_by_column_and_value_in_tables_only(done):
    for rows, why in (("question", "COLUMN=VALUE, got question"), ("a=b", "a table, got a study")):
        with pytest.raises(InputError, match=f"--where: expected {why}"):
            study("analyse", done, "--where", rows)


def test_uneven_counterbalancing_is_reported_before_the_first_session(tmp_path, capsys):
    note = "expected a multiple of 2 participants, because 2 orders of plain, grooved take turns, got 3"
    study("new", tmp_path / "odd", "--participants", 3, "--drives", "none")
    assert note in capsys.readouterr().err
    study("new", tmp_path / "even", "--participants", 2, "--drives", "none")
    assert "uneven" not in capsys.readouterr().err


@pytest.mark.long
def test_adaptive_blocks_whose_thresholds_will_be_biased_are_reported_before_the_first_session(tmp_path, capsys):
    note = "expected trials at the strongest level beside the adaptive ones"
    study("new", tmp_path / "good", "--template", "detection", "--participants", 1, "--drives", "none")
    assert note not in capsys.readouterr().err
    plan, found = re.subn(r" *\{ role = \"attention\".*\n", "", template_text("detection"))
    (tmp_path / "plan.toml").write_text(plan)
    study("new", tmp_path / "bad", "--source", tmp_path / "plan.toml", "--participants", 1, "--drives", "none")
    assert found == 1
    assert note in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.slow
def test_six_simulated_people_from_a_take_of_ones_own_to_its_threshold(tmp_path, capsys):
    """Its drive lies beside it, and is presented at 13 shares of its pressure."""
    save_drive(tmp_path / 'my "wool".drive.h5')
    take = ("--template", "detection", "--take", tmp_path / 'my "wool".h5')
    study("new", tmp_path / "faint", *take, "--participants", 6)
    assert 'my "wool".drive.h5: 0.02 s, copied' in capsys.readouterr().out
    assert study("run", tmp_path / "faint", "--simulate") == 0
    study("analyse", tmp_path / "faint", "--draws", 50)
    said = " ".join(capsys.readouterr().out.split())
    low, high = map(
        float, re.search(r"6 thresholds: [\d.]+ \(95 % limits over people ([\d.]+) to ([\d.]+)\)", said).groups()
    )
    assert 1 < low < 10 < high < 100, "per cent of the pressure of the drive"
    report = (tmp_path / "faint" / "report.html").read_text(encoding="utf-8")
    assert "Detection threshold of my &#34;wool&#34; in midair" in report


def test_a_study_without_answers_exports_nothing(tmp_path):
    study("new", tmp_path / "s", "--participants", 2, "--drives", "none")
    with pytest.raises(InputError, match="expected answers"):
        study("export", tmp_path / "s", tmp_path / "b")
    assert not (tmp_path / "b").exists()
    assert not (tmp_path / "s" / "made.jsonl").exists()


BY_HAND = """
name = "hand"
participants = 1
seed = 1
consent = "You may stop at any time."
questions = [{ name = "which", kind = "choice", text = "Which?", options = ["brush", "towel"], truth = "object" }]
stimuli = [
  { name = "b", kind = "object", source = "the brush", levels = { object = "brush" } },
  { name = "t", kind = "object", source = "the towel", levels = { object = "towel" } },
]
blocks = [{ name = "all", stimuli = ["b", "t"], questions = ["which"] }]
"""


def test_a_whole_session_by_hand(tmp_path, typed, capsys):
    (tmp_path / "hand.toml").write_text(BY_HAND)
    study("new", tmp_path / "s", "--source", tmp_path / "hand.toml")
    typed("\n\ncat\nbrush\n\ntowel\n")
    assert study("run", tmp_path / "s", "--participant", 1) == 0
    said = capsys.readouterr()
    assert "expected one of brush, towel, got 'cat'" in said.out
    assert "1 of 2 Which?" in " ".join(said.out.split())
    assert "present: the brush" in said.err
    assert "the brush" not in said.out  # the participant's screen
    (progress,) = StudyFolder(tmp_path / "s").sessions()
    assert [one.answer for one in progress.answers.values()] == ["brush", "towel"]


DRIVES = re.sub(r'object", source = "the \w+', 'drive", source = "focus.drive.h5', BY_HAND)


def study_of_drives(folder, level, frames=10):
    """A study whose two stimuli are ten frames of a focus beside the plan."""
    array = TransducerArray.autd3()
    phase = np.broadcast_to(focus_phase(array, np.array([0, 0, 0.2])), (frames, array.count))
    made = Settings().noted(Provenance())
    (folder / "drives.toml").write_text(DRIVES)
    save_drive(folder / "focus.drive.h5", phase, level, provenance=made)
    study("new", folder / "s", "--source", folder / "drives.toml")
    return folder / "s"


@pytest.mark.long
@pytest.mark.parametrize("array", ["virtual", "pyautd3:audit"])
def test_drives_play_on_any_array_and_are_logged(array, tmp_path, typed, capsys):
    folder = study_of_drives(tmp_path, level=0.001)
    typed("\nbrush\ntowel\n")
    assert study("run", folder, "--participant", 1, "--array", array, "--temperature", "15C", "--humidity", "40%") == 0
    assert (
        " ".join(capsys.readouterr().err.split()).count("focus.drive.h5: air: the room has 15 °C, 40 % humidity") == 1
    )
    first = json.loads((folder / "sessions" / "sub-01.jsonl").read_text(encoding="utf-8").splitlines()[0])
    assert first["room"] == {"temperature_c": 15.0, "humidity": 0.4}
    assert [entry["room"] for entry in log() if entry["event"] == "play"] == [first["room"]] * 2
    events = [(entry["event"], entry["drive"], entry["device"]) for entry in log()]
    assert events == [("play", "focus.drive.h5", array), ("end", "focus.drive.h5", array)] * 2
    assert {entry["participant"] for entry in log() if entry["event"] == "play"} == {"s/1"}
    (progress,) = StudyFolder(folder).sessions()
    assert [one.answer for one in progress.answers.values()] == ["brush", "towel"]
    assert progress.simulated


@pytest.mark.long
def test_drives_follow_a_palm_on_emulated_units(tap, tmp_path, typed, capsys):
    folder, moving = study_of_drives(tmp_path, level=0.004, frames=400), np.arange(6000) / 100
    centre = np.stack([5e-3 * np.sin(2 * np.pi * moving), 0 * moving, 0.2 + 0 * moving], axis=1)
    save_palm_path(palm_path(moving, centre), tmp_path / "hand.csv")
    typed("\nbrush\ntowel\n")
    line = ("--array", f"autd3:{tap.address}", "--follow", f"replay:{tmp_path / 'hand.csv'}")
    with pytest.raises(MidairError, match=r"--follow: expected --array autd3.*, got virtual"):
        study("run", folder, "--participant", 1, "--array", "virtual", "--follow", line[-1])
    assert study("run", folder, "--participant", 1, *line) == 0
    assert "the palm is followed" in capsys.readouterr().err
    assert [entry["event"] for entry in log()] == ["play", "end"] * 2
    sent = {bytes(datagram[20:269]) for _, _, order, datagram in tap.frames() if order == 0x16}
    assert len(sent) > 20, "5 when they are not steered: the frames of one focus differ, since they are steered"


@pytest.mark.long
def test_too_loud_a_drive_stops_the_session_before_it_begins(tmp_path, typed):
    folder = study_of_drives(tmp_path, level=1.0)
    with pytest.raises(InputError, match="dB at the"):
        study("run", folder, "--participant", 1, "--array", "pyautd3:audit")
    assert not (tmp_path / "played.jsonl").exists()
    typed("\nbrush\ntowel\n")
    answered_for = ("--override-exposure", "A. Person")
    assert study("run", folder, "--participant", 1, "--array", "pyautd3:audit", *answered_for) == 0
    assert {entry.get("override_by") for entry in log() if entry["event"] == "play"} == {"A. Person"}


def test_no_session_begins_without_its_hardware_stop(tmp_path):
    folder = study_of_drives(tmp_path, level=0.001)
    for line, word in (("serial:/dev/none", "nothing plays"), ("keyboard", "the answers need")):
        with pytest.raises(MidairError, match=word):
            study("run", folder, "--participant", 1, "--array", "virtual", "--stop-input", line)
        assert not (tmp_path / "played.jsonl").exists()
        assert not (folder / "sessions").exists()


def test_a_drive_that_was_changed_since_the_plan_is_refused(tmp_path):
    folder = study_of_drives(tmp_path, level=0.001)
    with pytest.raises(InputError, match="expected 1 to 1, got 9"):
        study("run", folder, "--participant", 9, "--array", "virtual")
    with (folder / "focus.drive.h5").open("ab") as file:
        file.write(b"\0")
    with pytest.raises(InputError, match=r"focus\.drive\.h5: .* changed after the plan was drawn"):
        study("run", folder, "--participant", 1, "--array", "virtual")
    assert not folder.joinpath("sessions").exists()


@pytest.mark.long
def test_everything_in_the_folder_is_for_its_owner_alone(tmp_path, typed):
    folder = study_of_drives(tmp_path, level=0.001)
    typed("\nbrush\ntowel\n")
    assert study("run", folder, "--participant", 1, "--array", "virtual") == 0
    study("analyse", folder, "--draws", 20)
    study("export", folder, folder / "bids")
    study("export", folder, folder / "answers.csv", "--format", "csv")
    modes = {path.name: path.stat().st_mode & 0o777 for path in (folder, *folder.rglob("*"))}
    assert {name: oct(mode) for name, mode in modes.items() if mode & 0o077} == {}


@pytest.mark.long
def test_the_printed_next_runs_as_printed(tmp_path, typed, capsys):
    """With drives that are there already, since virtual strokes take half a minute."""
    study_of_drives(tmp_path, level=0.001)
    said = [line for line in capsys.readouterr().out.splitlines() if "midair study run" in line]
    assert len(said) == 2
    for number, line in enumerate(said, start=1):
        words = shlex.split(line.partition("midair study ")[2])
        typed("\nbrush\ntowel\n")
        assert study(*words) == 0, line
        if number == 1:
            (tmp_path / "s" / "sessions" / "sub-01.jsonl").unlink()
    capsys.readouterr()
    assert study(*shlex.split(said[0].partition("midair study ")[2])) == 0
    assert "participant 1 has already finished" in capsys.readouterr().out


def test_every_command_reports_a_damaged_log(tmp_path, capsys):
    folder = tmp_path / "edited"
    (tmp_path / "hand.toml").write_text(BY_HAND)
    study("new", folder, "--source", tmp_path / "hand.toml", "--participants", 2)
    assert study("run", folder, "--simulate") == 0
    capsys.readouterr()
    study("analyse", folder, "--draws", 20, "--json")
    assert json.loads(capsys.readouterr().out)["simulated"] is True
    log = folder / "sessions" / "sub-02.jsonl"
    log.write_bytes(log.read_bytes().replace(b'"answer": "', b'"answer": ', 1))
    for words in (("analyse", folder), ("export", folder, tmp_path / "b"), ("run", folder, "--simulate")):
        with pytest.raises(BrokenFileError, match=r"sub-02\.jsonl: .* damage in line"):
            study(*words)


def test_a_terminal_that_is_closed_stops_the_session(tmp_path, typed):
    (tmp_path / "hand.toml").write_text(BY_HAND)
    study("new", tmp_path / "s", "--source", tmp_path / "hand.toml")
    typed("\n\n1\n")
    with pytest.raises(InputError, match="end of input"):
        study("run", tmp_path / "s", "--participant", 1)
    folder = StudyFolder(tmp_path / "s")
    (progress,) = folder.sessions()
    assert [one.answer for one in progress.answers.values()] == ["brush"]
    assert read_events(folder.log(1))[-1]["event"] == "stop"


def test_power(capsys):
    for test, many in {"paired": 15, "identification": 3, "rating": 43, "equivalence": 15, "threshold": 23}.items():
        study("power", test, "--effect", 0.8)
        assert capsys.readouterr().out.startswith(f"{many} participants"), test
