import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from tests.waiting import wait_until

from midair.cli import run
from midair.files import from_plain
from midair.model import Acoustics, Medium
from midair.sweep import PatternSweep, load_sweep

SMALL = ["--count", "12", "--chunk", "4", "--iterations", "1", "--workers", "2"]


@pytest.mark.long
def test_from_patterns_to_a_report(capsys, one_line, answer):
    ask = ["sweep", "patterns", "s.sweep", "--strength", "0.1", "0.2", "--height", "180mm", "20cm", *SMALL]
    assert run(ask) == 0
    said = capsys.readouterr()
    assert "48/48" in said.err
    assert "SIMULATED" in said.out
    assert "48 targets solved, each pattern at each strength and height; " in said.out
    sweep = from_plain(PatternSweep, load_sweep(Path("s.sweep")).settings)
    assert sweep.strengths == (0.1, 0.2)
    assert sweep.heights == pytest.approx((0.18, 0.2))
    assert sweep.iterations == 1
    report = answer("sweep", "report", "s.sweep")
    assert report["simulated"] is True
    assert [row["patterns"] for row in report["conditions"]] == [12] * 4
    assert all(Path(name).is_file() for name in report["files"])
    assert run([*ask, "--seed", "7"]) == 1
    line = one_line()
    assert "seed" in line
    assert "2024" in line


@pytest.mark.long
def test_the_air_of_patterns_is_the_paper_s_or_the_stated_one():
    small = ["--strength", "0.1", "--count", "2", "--iterations", "1", "--workers", "1"]
    for words, medium in (
        ("", Medium(attenuation=0.0)),
        ("--attenuation 0.1", Medium(attenuation=0.1)),
        ("--temperature 25C --humidity 30%", Medium.at(temperature=25.0, humidity=0.3)),
        ("--temperature 25C --attenuation 0", replace(Medium.at(temperature=25.0), attenuation=0.0)),
    ):
        assert run(["sweep", "patterns", f"{medium.speed}-{medium.attenuation}.sweep", *small, *words.split()]) == 0
        folder = Path(f"{medium.speed}-{medium.attenuation}.sweep")
        sweep = from_plain(PatternSweep, load_sweep(folder).settings)
        assert sweep.acoustics == Acoustics(medium=medium, directivity="point"), words


@pytest.mark.long
def test_ctrl_c_is_one_line_and_results_are_kept():
    """A terminal sends it to every process of the command."""
    program = [sys.executable, "-c", "from midair.cli import main; main()", "sweep", "patterns", "s.sweep"]
    running = subprocess.Popen(
        [*program, "--count", "2000", "--chunk", "8", "--strength", "0.1", "--workers", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait_until(lambda: list(Path("s.sweep").glob("*.npz")), 120)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "Traceback" not in said
    assert "midair: stopped; the results so far are stored" in said
    assert not load_sweep(Path("s.sweep")).complete


COARSE = ["--mode", "paper", "--set", "target.grid={rows=6,columns=6,pitch=0.011}", "--workers", "1"]


@pytest.mark.long
def test_recordings_under_settings(take, capsys, one_line, answer):
    ask = ["sweep", "recordings", "r.sweep", take, "--vary", "method=fast,glide", "height=150mm,200mm"]
    ask += ["--duration", "20ms", *COARSE]
    assert run(ask) == 0
    said = capsys.readouterr()
    assert "80/80" in said.err
    assert "SIMULATED" in said.out
    report = answer("sweep", "report", "r.sweep")
    assert [trial["variant"] for trial in report["trials"]] == [
        f"method={method} height={height}" for method in ("fast", "glide") for height in ("150mm", "200mm")
    ]
    assert all(Path(name).is_file() for name in report["files"])
    assert run([*ask, "--bits", "4"]) == 1
    assert "bits" in one_line()
