import html
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from midair.cli import run
from midair.datasets import sample_path
from midair.files import load, load_calibration
from midair.model import Medium

QUICK = ["--mode", "paper", "--set", "target.grid={rows=6,columns=6,pitch=0.011}", "--set", "solver.iterations=[2,1]"]


@pytest.mark.long
def test_a_recording_is_solved_as_it_plays(take):
    assert run(["play", "take.h5", *QUICK, "--duration", "20ms"]) == 0
    assert load("take.rerecorded.h5").frames > 20
    assert not Path("take.drive.h5").exists()


@pytest.mark.long
def test_the_air_of_the_room_is_checked_at_play_and_phases_are_corrected_for_it(take, capsys):
    """The re-recording is of the stated air, and without a word of the drive's own."""
    here = ["--temperature", "26C", "--start-at", "0.1s", "--duration", "0.05s"]
    assert run(["solve", "take.h5", *QUICK, *here]) == 0
    heard = {}
    for name, room in {"own": "", "near": "27C", "far": "14C", "corrected": "29.5C --correct-air"}.items():
        capsys.readouterr()
        words = f"play take.drive.h5 --output {name}.h5 {room and '--temperature'} {room}"
        assert run(words.split()) == 0
        heard[name] = (load(f"{name}.h5"), capsys.readouterr().err)
    assert "air: 26 °C, 50 % humidity, the drive's own" in heard["own"][1]
    assert "instead of" not in heard["near"][1]
    assert "the room has 14 °C, 50 % humidity, the drive was solved for 26 °C" in heard["far"][1]
    assert " % instead of " in heard["far"][1]
    changes = [np.abs(heard[name][0].samples - heard["own"][0].samples).max() for name in ("near", "far")]
    assert 0 < changes[0] < changes[1]
    corrected, said = heard["corrected"]
    assert "air: phases corrected from 26 °C, 50 % humidity to 29.5 °C, 50 % humidity" in said
    (step,) = [each for each in corrected.provenance.steps if each.stage == "correct_air"]
    assert step.settings["to_m_s"] == Medium.at(temperature=29.5).speed


@pytest.mark.long
def test_real_data_from_csv_to_comparison(answer):
    """A fabric recorded by a real finger: slow, in counts, with its own band."""
    assert run(["import", "sample:denim", "denim.h5", "--peak", "30Pa"]) == 0
    assert load_calibration("denim.h5") is not None
    slow = ["--band", "1Hz", "15Hz", "--rate", "100Hz", "--start-at", "3s", "--duration", "1.5s"]
    assert run(["solve", "denim.h5", *QUICK, *slow]) == 0
    assert run(["play", "denim.drive.h5"]) == 0
    assert answer("compare", "denim.h5", "denim.rerecorded.h5")["figures"]["correlation"]["value"] > 0.5


def test_real_data_has_nothing_in_the_paper_s_band(one_line):
    assert run(["import", "sample:denim", "denim.h5", "--peak", "30Pa"]) == 0
    assert run(["solve", "denim.h5"]) == 1
    assert "17.8" in one_line()
    assert not Path("denim.drive.h5").exists()


def test_counts_without_a_calibration_are_refused_with_a_way_out(one_line):
    assert run(["import", str(sample_path("denim")), "denim.h5"]) == 0
    assert run(["solve", "denim.h5", "--band", "1Hz", "15Hz"]) == 1
    assert "calibration" in one_line()
    assert run(["calibrate", "denim.h5", "--sensitivity", "2count/Pa", "--band", "1Hz", "15Hz"]) == 0
    assert load_calibration("denim.h5").response[0, 0, 0] == 2


@pytest.mark.long
def test_info_prints_the_history_of_a_file(take, answer):
    run(["solve", "take.h5", *QUICK, "--duration", "0.02s"])
    told = answer("info", "take.drive.h5")
    assert [step["stage"] for step in told["steps"]] == [
        *("calibrate", "cut", "not reproduced", "lead", "settings", "prepare", "solve")
    ]
    assert told["simulated"] is True


def test_repair_of_a_file_that_needs_none(take, capsys):
    before = load("take.h5").samples
    assert run(["repair", "take.h5"]) == 0
    assert "no repair needed" in capsys.readouterr().out
    np.testing.assert_array_equal(load("take.h5").samples, before)


@pytest.mark.long
def test_demo_writes_a_report_and_its_files(capsys):
    assert run(["demo", "out", "--duration", "0.05s", *QUICK, "--all"]) == 0
    assert {path.name for path in Path("out").iterdir()} == {
        "report.html",
        "stroke.h5",
        "rerecorded.h5",
        "towel.drive.h5",
    }
    captured = capsys.readouterr()
    assert "SIMULATED" in captured.out
    assert "frames/s" in captured.err
    assert "palm  " in captured.out
    assert "disc of 85 mm; signal to distortion" in captured.out
    assert "Fidelity on a whole palm" in Path("out/report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_demo_shows_the_paper_s_mode_beside_the_best(capsys):
    coarse = "--set target.grid={rows=6,columns=6,pitch=0.011} --rate 2kHz --mode quick"
    assert run(["demo", "out", "--duration", "0.08s", *coarse.split()]) == 0
    said = capsys.readouterr().out
    page = html.unescape(Path("out/report.html").read_text(encoding="utf-8"))
    assert re.search(r"Felt by about \d+ of 10 people", page)
    assert re.search(r"\nears +\d+ dB too loud without protection +\d+ dB too loud without protection", said), said
    assert "leak: power beside the recorded square" in page
    assert re.search("the quick mode +the paper's mode", said)


@pytest.mark.slow
def test_the_picture_of_the_readme_is_the_one_that_the_demo_draws_and_the_texture_keeps_its_frequency(chromium):
    assert run(["demo", "out"]) == 0
    page = Path("out/report.html").read_text(encoding="utf-8")
    heard = re.findall(r"dominant frequency, (?:original|reproduced)</td>((?:<td>[\d.]+</td>)+)", page)
    before, after = ([float(number) for number in re.findall(r">([\d.]+)<", each)] for each in heard)
    # Half a second tells 2 Hz apart.
    assert before == after == [52.0]
    opened = chromium.new_page(viewport={"width": 1400, "height": 900})
    opened.goto(Path("out/report.html").absolute().as_uri())
    opened.locator("section.hands").screenshot(path="palm.png")
    opened.close()
    drawn, shown = (
        np.asarray(Image.open(path).convert("L"), float)
        for path in ("palm.png", Path(__file__).parents[2] / "docs/images/palm.png")
    )
    assert drawn.shape == shown.shape
    # Another machine's arithmetic and fonts move a line by less than its width.
    assert np.abs(drawn - shown).mean() < 4


@pytest.mark.slow
def test_the_paper_s_mode_by_glide_is_that_by_its_own_solver(answer):
    run(["record", "virtual:towel", "stroke.h5", "--duration", "1.28s"])
    part, heard = ["--start-at", "0.5s", "--duration", "0.1s", "--corrections", "0"], []
    for method in ("lm", "glide"):
        told = answer("loop", "stroke.h5", "--mode", "paper", "--method", method, *part, "--force")
        heard.append(told["passes"][-1]["figures"]["signal to distortion"]["value"])
    assert heard[0] == pytest.approx(heard[1], abs=0.2)
