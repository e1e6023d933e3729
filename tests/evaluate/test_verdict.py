"""The verdict: the same lines wherever it is shown."""

import json
import re

import numpy as np
import pytest

from midair.evaluate import ALL, ALL_MEASURED, Felt, LaboratoryLoss, Place, Verdict, too_loud, ways_to_play

FELT = Felt(levels={"soft": 8.0, "stiff": 0.0})


def test_every_line_says_what_is_known_in_words(subtests):
    lab = LaboratoryLoss(
        nominal=33.0,
        ratios={ALL: np.linspace(4, 20, 9), ALL_MEASURED: np.linspace(22, 30, 9), "echo": np.ones(3)},
        stated={"echo": "10 %", ALL: ""},
        seed=0,
    )
    whole = Verdict(
        felt=FELT, place=Place(shift=(3e-3, -2e-3), turn=0.09), fidelity=31.84,
        spectrum=10.0, gain=0.82, option="--gain 1.22", excess=37.2, laboratory=lab,
        left_out="the slow press below 20 Hz, 72 % of the power: --circle 3mm",
    )  # fmt: skip
    assert dict(whole.rows()) == {
        "felt": "by about 7 of 10 people (5 to 8; model of skin)",
        "alike": "the same: 31.8 dB on the touched cells",
        "level": "18 % weaker: solve with --gain 1.22",
        "place": "3.6 mm, 5° off; people feel points under 15 mm apart as one",
        "ears": "37 dB too loud without protection",
        "laboratory": "26 dB (22 to 30), array measured; 12 dB if not",
        "left out": "the slow press below 20 Hz, 72 % of the power: --circle 3mm",
    }
    assert json.dumps(whole.plain())
    assert str(whole).splitlines()[0].startswith("felt        by about 7")
    assert all(len(line) <= 80 for line in str(whole).splitlines())
    for fidelity, spectrum, gain, alike, level in (
        (8.0, 40.0, 3.0, "similar, another spectrum: 8.0 dB on the touched cells", "3 times as strong"),
        (2.0, None, 1.05, "different: 2.0 dB on the touched cells", "as strong as the original (5 % stronger)"),
        (2.0, None, 0.998, "different: 2.0 dB on the touched cells", "as strong as the original"),
        (2.0, None, -0.1, "different: 2.0 dB on the touched cells", "the original is not in it"),
    ):
        with subtests.test(gain=gain):
            rows = dict(Verdict(felt=FELT, place=Place(), fidelity=fidelity, spectrum=spectrum, gain=gain).rows())
            assert (rows["alike"], rows["level"]) == (alike, level)
            assert list(rows) == ["felt", "alike", "level"]
    assert (too_loud(-3.0), too_loud(0.04)) == ("within the limit", "0.1 dB too loud without protection")


def test_ways_to_play_follow_from_scaling_and_none_is_assumed():
    ways = {way.name: way for way in ways_to_play(FELT, 36.0, source="take.h5")}
    felt = {name: None if way.felt is None else way.felt.levels["soft"] for name, way in ways.items()}
    assert felt == {
        "protect all ears in the room": 8.0 - 2 * 5,
        "solve for quiet ears": None,
        "play it weaker": 8.0 - 2 * 36,
        "answer for it by name": 8.0,
    }
    assert ways["protect all ears in the room"].option == "--ear-protection 31dB --attenuate"
    assert ways["solve for quiet ears"].row[1:] == ("see --plan", "midair solve take.h5 --mode quiet")
    solved = ways_to_play(FELT, 20.0, quiet=FELT.at(-20))
    assert [way.row[1] for way in solved] == ["7 of 10", "0 of 10", "0 of 10", "7 of 10"]
    assert solved[0].option == "--ear-protection 31dB"


def words(text):
    return " ".join(re.findall(r"[\w.%-]+", text))


@pytest.mark.long
def test_command_json_report_studio_and_python_print_the_same_lines(tmp_path, monkeypatch, capsys):
    from midair.cli.app import run
    from midair.evaluate import compare, metrics_or_none
    from midair.files import open_take
    from midair.rig import aligned_pair, next_step, pressure_of
    from midair.settings import Settings
    from midair.studio.take_data import page_rows
    from midair.studio.work import compare_takes

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    assert run(["record", "virtual:towel", "take.h5", "--duration", "0.6s"]) == 0
    assert run(["solve", "take.h5", "--method", "fast", "--start-at", "0.4s", "--duration", "0.1s"]) == 0
    assert run(["play", "take.drive.h5"]) == 0
    capsys.readouterr()
    assert run(["compare", "take.h5", "take.rerecorded.h5", "--report", "page.html"]) == 0
    printed = re.sub(r" +", " ", capsys.readouterr().out)
    assert run(["compare", "take.h5", "take.rerecorded.h5", "--json"]) == 0
    lines = json.loads(capsys.readouterr().out)["verdict"]["lines"]
    shown = compare_takes(("take.h5", "take.rerecorded.h5", "kept.npz", "take.drive.h5"), lambda *_: None)
    assert shown["verdict"] == page_rows(list(lines.items())), "without the dashes of options"
    assert lines["ears"].endswith(" dB too loud without protection")
    take = open_take("take.rerecorded.h5")
    settings = Settings.of(take.recording.provenance)
    pair = aligned_pair(pressure_of("take.h5", settings), take, settings)
    found = compare(pair.original, pair.heard, first=pair.first, noise=pair.noise)
    card, option = metrics_or_none(pair.original, pair.piece), next_step(found.gain, settings)
    assert dict(Verdict.of(found, pair.piece, card, option=option).rows()) == lines
    assert lines["alike"].partition(": ")[2] in repr(found)
    # The page has marks such as ": " as a new line.
    page = words(re.sub("<[^>]+>", " ", (tmp_path / "page.html").read_text(encoding="utf-8")))
    for name, text in lines.items():
        assert f"{name} {text}" in printed
        assert words(text) in page
