"""What people type wrong, all in one table: one line that says so, the status, nothing left, nothing changed."""

import os
import shlex
import signal
import sys
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import soundfile

from midair.cli import main, run
from midair.files import atomic_file, save
from midair.model import Recording, SensorGrid

ROWS = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8").splitlines()
MISTAKES = [tuple(row.split(" | ")) for row in ROWS if row and not row.startswith("#")]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mistakes")
    with chdir(folder):
        rng = np.random.default_rng(3)
        samples = rng.normal(size=(300, 4, 4))
        for name in ("raw.h5", "take.h5", "there.h5"):
            save(Recording(samples=samples, rate=1000), name)
        assert run(["calibrate", "take.h5", "--peak", "30Pa", "--force"]) == 0
        quick = "--mode paper --method fast --duration 10ms --lead 0s"
        assert run(["solve", "take.h5", "there.drive.h5", *quick.split()]) == 0
        small = {"rate": 1000, "unit": "Pa", "sensor": SensorGrid(rows=2, columns=2)}
        save(Recording(samples=samples[:, :2, :2], **small), "small.h5")
        soundfile.write("song.wav", 0.5 * np.sin(np.arange(4000) / 9), 8000)
        soundfile.write("silent.wav", [], 8000)
        Path("text.csv").write_text("this is\nno recording\n")
        Path("ragged.csv").write_text("1,2,3\n4,5\n6,7,8\n")
        Path("truncated.h5").write_bytes(Path("take.h5").read_bytes()[:2000])
        np.savetxt("five.csv", rng.normal(size=(50, 5)), delimiter=",", header="a,b,c,d,e", comments="")
        gaps = rng.normal(size=(50, 16))
        gaps[3, 3] = np.nan
        np.savetxt("gaps.csv", gaps, delimiter=",")
        Path("ticks.csv").write_text("time,a\n" + "".join(f"{at},{at % 7}\n" for at in range(5, 400)))
        Path("unit.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n')
        assert run(["study", "new", "drawn", "--participants", "2", "--drives", "none"]) == 0
        Path("there").mkdir()
        for name, text in (("empty.h5", ""), ("broken.toml", "a = = 3"), ("x.m4a", "x"), ("there/report.html", "x")):
            Path(name).write_text(text)
    return folder


def state(folder):
    return {path: path.stat().st_mtime_ns for path in sorted(folder.rglob("*"))}


@pytest.mark.parametrize("part", range(2))
def test_a_mistake_is_one_line(files, monkeypatch, capsys, part):
    monkeypatch.chdir(files)
    wrong = []
    for status, typed, words in MISTAKES[part::2]:
        before = state(files)
        capsys.readouterr()
        got = run(shlex.split(typed))
        lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("midair: ")]
        good = got == int(status) and len(lines) == 1 and words in lines[0] and "error in midair" not in lines[0]
        if not good or state(files) != before:
            wrong.append(f"{typed}: {got} {lines}, changed: {state(files) != before}")
    assert wrong == []


def test_a_request_to_end_leaves_no_unfinished_file(tmp_path, monkeypatch):
    def work(tokens):
        with atomic_file(tmp_path / tokens[0]):
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(sys.modules["midair.cli.app"], "_run_to_exit", work)
    with pytest.raises(SystemExit, match=str(128 + signal.SIGTERM)):
        main(["stop", "it"])
    assert list(tmp_path.iterdir()) == []
