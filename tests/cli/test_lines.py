"""How much each command prints by default: few lines, none wider than 80 columns, and the answer first."""

import shlex
from pathlib import Path

import pytest

from midair.cli import run

COARSE = "--set target.grid={rows=6,columns=6,pitch=0.011} --duration 10ms"
ROWS = [
    (6, "SIMULATED  0.3 s of towel, 16 cells", "record virtual:towel take.h5 --duration 0.3s"),
    (14, "SIMULATED  recording of 0.3 s of towel", "info take.h5"),
    (10, "SIMULATED  ", f"solve take.h5 --mode paper --method fast --lead 0s --placement unit.toml {COARSE}"),
    (14, "SIMULATED  drive of 0.01 s at 1000 Hz for ", "info take.drive.h5"),
    (12, "SIMULATED  ", "exposure take.drive.h5"),
    (10, "SIMULATED  played 0.01 s on the virtual array", "play take.drive.h5"),
    (12, "SIMULATED  ", "compare take.h5 take.rerecorded.h5"),
    (8, "SIMULATED  0.1 s of towel", "cut take.h5 part.h5 --end 0.1s"),
    (14, "", "import sample:ridges"),
    (8, "SIMULATED  ", "calibrate take.h5"),
    (6, "SIMULATED  0.3 s of towel, 16 cells", "export take.h5 take.csv"),
    (4, "", "gallery heartbeat"),
    (16, "", "gallery"),
]
"""Most lines, the beginning of the first line, and the command; each uses the files of those before it."""

LONG = [
    (25, "SIMULATED  ", f"loop take.h5 report.html --mode paper --method fast {COARSE}"),
    (30, "SIMULATED  ", f"demo there --mode paper --method fast {COARSE}"),
    (12, "", "doctor"),
    (10, "SIMULATED  ", f"budget take.h5 budget.png --mode paper --method fast {COARSE}"),
    (10, "SIMULATED  8 targets solved", "sweep patterns s.sweep --count 4 --workers 1 --iterations 2"),
]


def too_much(capsys, rows):
    wrong = []
    for most, first, words in rows:
        capsys.readouterr()
        assert run(shlex.split(words)) == 0, words
        lines = capsys.readouterr().out.splitlines()
        wide = [line for line in lines if len(line) > 80 or line.endswith(" ")]
        if len(lines) > most or wide or not lines[0].startswith(first):
            wrong.append((words, len(lines), wide, lines[0]))
    return wrong


@pytest.fixture(autouse=True)
def _narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    Path("unit.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n')


def test_a_command_prints_few_lines_and_the_answer_first(capsys):
    assert too_much(capsys, ROWS) == []


@pytest.mark.long
def test_long_commands_print_few_lines_too(capsys):
    assert run(["record", "virtual:towel", "take.h5"]) == 0
    assert too_much(capsys, LONG) == []
