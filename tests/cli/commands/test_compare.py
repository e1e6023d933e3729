import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from midair.cli import run
from midair.evaluate import apply_band_twice, fidelity
from midair.files import load_solution, open_take, save
from midair.model import Recording
from midair.pipeline import calibrated_pressure, required_lead
from midair.rig import aligned_pair, original_of_drive
from midair.settings import Settings
from midair.targets import add_lead

COARSE = shlex.split(
    "--set target.grid={rows=4,columns=4,pitch=0.011} --method fast --set solver.iterations=[1,1] --set solver.guard=0"
)

pytestmark = pytest.mark.usefixtures("with_take")


def perfect(drive_file):
    """The wanted pressure itself through the sensor's calibration, as a re-recording of that drive."""
    take, drive = open_take("take.h5"), load_solution(drive_file).drive
    settings = Settings.of(drive.provenance)
    wanted = add_lead(
        calibrated_pressure(take.recording, take.calibration, settings).cut(0.55, 0.1), required_lead(settings)
    )
    assert wanted.frames == drive.frames
    length, times = 4000, round(wanted.rate / 1000)
    spectrum = np.fft.rfft(wanted.pressure, length * times, axis=0)[: length // 2]
    response = take.calibration.response_at(np.fft.rfftfreq(length, 1e-3)[:-1])
    volts = np.fft.irfft(spectrum * response / times, length, axis=0)[: round(1000 * drive.frames / drive.rate) + 20]
    played = drive.provenance.then("play", {"array": "virtual", "frames": drive.frames, "rate_hz": drive.rate})
    again = Recording(samples=volts, rate=1000.0, sensor=take.recording.sensor, provenance=played)
    save(again, "again.h5", calibration=take.calibration)


@pytest.mark.long
def test_a_perfect_chain_scores_above_60_db_in_any_order_and_if_it_was_cut_not_at_all(answer, capsys):
    for mode in ("paper", "best --rate 2kHz"):
        part = ["--start-at", "0.55s", "--duration", "0.1s", "--force", "--mode", *mode.split()]
        assert run(["solve", "take.h5", *part, *COARSE]) == 0
        perfect("take.drive.h5")
        figures = answer("compare", "take.h5", "again.h5")["figures"]
        assert figures["signal to distortion"]["value"] > 60, mode
        assert figures["waveform error"]["value"] < 0.1, mode
        assert abs(figures["delay"]["value"]) < 1e-3, mode
    answers = []
    for pair in (["take.h5", "again.h5"], ["again.h5", "take.h5"]):
        assert run(["compare", *pair, "--json"]) == 0
        said = capsys.readouterr()
        answers.append(json.loads(said.out))
    assert answers[0] == answers[1]
    assert "again.h5 is a reproduction: compared with take.h5 as the original" in " ".join(said.err.split())
    assert run(["cut", "again.h5", "part.h5", "--start", "0.05s", "--force"]) == 0
    capsys.readouterr()
    assert run(["compare", "take.h5", "part.h5"]) == 1
    assert "expected it as it was played, got one after cut; compare the whole one" in capsys.readouterr().err


def test_a_recording_that_was_never_played_is_compared_unchanged(capsys):
    assert run(["compare", "take.h5", "take.h5", "--json"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["figures"]["signal to distortion"]["value"] > 150
    assert "it is compared with itself" in told.err


@pytest.mark.long
def test_a_drive_is_played_to_a_virtual_sensor_and_a_whole_palm(answer, capsys):
    assert run(["solve", "take.h5", "--mode", "paper", *COARSE, "--start-at", "0.55s", "--duration", "0.1s", "-f"]) == 0
    Path("coarse.toml").write_text("disc_mm = 85\npitch_mm = 5")
    compare = ["compare", "take.h5", "take.drive.h5", "--palm", "coarse.toml"]
    told = answer(*compare)
    assert told["simulated"]
    assert told["figures"]["signal to distortion"]["value"] < 10  # half a wave is gone
    assert 0.05 < told["palm"]["outside"] < 1
    assert len(told["palm"]["sdr_displacement_db"]) == 4
    assert told["verdict"]["lines"]["felt"].startswith("by about ")
    assert "array measured" in told["verdict"]["lines"]["laboratory"]
    fixed = answer(*compare, "--fixed-place")["verdict"]["laboratory_db"]
    assert all(ratio < told["verdict"]["laboratory_db"][name] for name, ratio in fixed.items())
    # Its palm can be filmed.
    assert run(["solve", "take.h5", "--mode", "paper", *COARSE, "--start-at", "0.5s", "--duration", "0.01s", "-f"]) == 0
    assert run([*compare, "--film", "palm.gif", "--report", "p.html"]) == 0
    assert re.search("film +palm.gif", capsys.readouterr().out)
    page = Path("p.html").read_text(encoding="utf-8")
    assert "Fidelity on a whole palm, coarse" in page
    assert "displacement, worst skin" in page
    with Image.open("palm.gif") as film:
        assert film.n_frames == 10


@pytest.mark.long
def test_a_drive_of_another_recording_is_refused_or_told(capsys):
    assert run(["solve", "take.h5", "--mode", "paper", *COARSE, "--duration", "0.02s", "-f"]) == 0
    assert run(["record", "virtual:towel", "short.h5", "--duration", "0.1s"]) == 0
    Path("other.drive.h5").write_bytes(Path("take.drive.h5").read_bytes())
    assert run(["solve", "take.h5", "other.drive.h5", "--mode", "paper", *COARSE, "--duration", "0.2s", "-f"]) == 0
    assert run(["compare", "short.h5", "other.drive.h5"]) == 1
    assert run(["record", "virtual:sponge", "sponge.h5"]) == 0
    assert run(["compare", "sponge.h5", "take.drive.h5"]) == 0
    assert "take.drive.h5 was made of another recording than sponge.h5" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_palm_fidelity_of_a_drive_equals_that_of_the_budget(answer):
    piece = ["--mode", "paper", *COARSE, "--start-at", "0.55s", "--duration", "0.1s"]
    assert run(["solve", "take.h5", *piece, "-f"]) == 0
    told = answer("compare", "take.h5", "take.drive.h5")["palm"]
    budgeted = answer("budget", "take.h5", *piece)["palm"]
    assert told["outside"] == pytest.approx(budgeted["outside"], rel=1e-3)
    assert told["sdr_pressure_db"] == pytest.approx(budgeted["sdr_pressure_db"], abs=0.05)


def test_a_report_holds_the_figures_and_both_recordings(capsys):
    assert run(["compare", "take.h5", "take.h5", "--report", "compared.html"]) == 0
    said = capsys.readouterr().out
    page = Path("compared.html").read_text(encoding="utf-8")
    assert "report  compared.html" in said
    order = ("SIMULATED", 'class="message">Felt', "<i>alike", 'data-name="again"', "<details>", "signal to distortion")
    assert sorted(order, key=page.index) == list(order)
    assert (page.count("data:audio/wav"), "midair compare take.h5 take.h5" in page) == (2, True)


@pytest.mark.long
def test_a_level_that_is_off_comes_with_the_option_that_corrects_it(capsys):
    # A drive of its own: other tests of this folder solve other parts.
    solve = "solve take.h5 level.drive.h5 --start-at 0.55s --duration 0.1s --force"
    assert run([*solve.split(), *COARSE]) == 0
    perfect("level.drive.h5")
    again = open_take("again.h5")
    weaker = replace(again.recording, samples=0.8 * again.recording.samples)
    save(weaker, "weaker.h5", calibration=again.calibration)
    capsys.readouterr()
    assert run(["compare", "take.h5", "weaker.h5", "--all"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "20 % weaker: solve with --gain 1.25" in said
    lines = [said.index(each) for each in ("felt by about", "alike the same", "level 20 %", "correlation")]
    assert lines == sorted(lines)


def quoted(original, reproduced):
    """The ratios by `fidelity`, as pages and budgets quote them: sharp edges of the band, cut after filtering."""
    take, source = open_take(reproduced), open_take(original)
    settings = Settings.of(take.recording.provenance)
    pressure = calibrated_pressure(source.recording, source.calibration, settings)
    pair = aligned_pair(pressure, take, settings)
    _, asked = original_of_drive(take.recording.provenance, pressure)
    judged = (pair.first / pair.heard.rate, pair.original.frames / pair.original.rate)
    found = fidelity(apply_band_twice(asked), pair.heard, judged=judged, noise=pair.noise).ratios
    assert len(found) == 4
    return {name: ratio for name, (ratio, _, _) in found.items()}


def printed(answer, *arguments):
    figures = answer("compare", *arguments)["figures"]
    return {name: figure["value"] for name, figure in figures.items() if name.startswith("signal to distortion")}


@pytest.mark.long
def test_the_printed_ratios_are_those_of_the_documentation(capsys, answer):
    assert run(["solve", "take.h5", "a.drive.h5", "--start-at", "0.55s", "--duration", "0.1s", *COARSE, "--force"]) == 0
    capsys.readouterr()
    assert run(["play", "a.drive.h5", "--force"]) == 0
    played = " ".join(capsys.readouterr().out.split())
    assert f"felt {answer('compare', 'take.h5', 'a.rerecorded.h5')['verdict']['lines']['felt']}" in played
    found = printed(answer, "take.h5", "a.rerecorded.h5")
    assert found == pytest.approx(quoted("take.h5", "a.rerecorded.h5"), abs=0.5)


@pytest.mark.slow
def test_the_start_page_has_the_ratios_of_its_commands(tmp_path, monkeypatch, answer):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "docs" / "start.md").read_text(encoding="utf-8")
    by_hand = page[page.index("## Do it by hand") : page.index("## In Python")]
    *commands, last = re.findall(r"^\$ midair (.*)$", by_hand, re.MULTILINE)
    for line in commands:
        assert run(line.split()) == 0
    told = float(re.search(r"alike +the same: ([0-9.]+) dB", by_hand)[1])
    found = printed(answer, *last.split()[1:])
    assert found["signal to distortion, touched cells, without noise"] == pytest.approx(told, abs=0.5)
    assert found == pytest.approx(quoted(*last.split()[1:]), abs=0.5)
