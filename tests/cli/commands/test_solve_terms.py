import json
import shlex

import pytest

from midair.cli import run
from midair.files import load_solution

SMALL = shlex.split("--mode paper --set target.grid={rows=6,columns=6,pitch=0.011} --start-at 20ms --duration 10ms")
SMALL += ["--lead", "0s"]


@pytest.fixture(scope="module")
def stroke(tmp_path_factory):
    path = tmp_path_factory.mktemp("terms") / "am.h5"
    assert run(["record", "virtual:am-i", str(path), "--duration", "0.1s"]) == 0
    return path


@pytest.mark.long
def test_the_terms_reach_the_drive_that_is_written(stroke, tmp_path):
    drive = tmp_path / "am.drive.h5"
    lines = "guard.margin=0.022 amplitudes=bounded smooth=0.003 level=auto fit=cells backend=numpy"
    words = f"--method fast {' '.join(f'--set solver.{line}' for line in lines.split())}"
    assert run(["solve", str(stroke), str(drive), *words.split(), *SMALL]) == 0
    solution = load_solution(drive)
    made = solution.drive.provenance.steps[-1].settings
    assert (made["guard_margin"], made["smooth"]) == (0.022, 0.003)
    assert (made["amplitudes"], made["fit"], made["backend"]) == ("bounded", "cells", "numpy")
    level = solution.drive.level
    assert level.shape == (10, 996)
    assert level.max() <= made["level"] + 0.5 / 255
    assert made["level"] < 1


@pytest.mark.long
def test_a_temperature_range_reaches_the_drive(stroke, tmp_path):
    drive = tmp_path / "am.drive.h5"
    words = "--method fast --mapping slow-bias --temperature 22C --set solver.robust=2 --lead 40ms"
    assert run(["solve", str(stroke), str(drive), *words.split(), *SMALL[:-2]]) == 0
    assert load_solution(drive).drive.provenance.steps[-1].settings["robust_c"] == 2


@pytest.mark.long
def test_strength_is_printed_in_pascal_with_a_warning_above_the_limit(stroke, tmp_path, capsys):
    drive = tmp_path / "am.drive.h5"
    assert run(["solve", str(stroke), str(drive), "--method", "fast", "--strength", "0.1", *SMALL]) == 0
    told = capsys.readouterr()
    assert "too strong" not in told.err
    assert (
        run(["solve", str(stroke), str(drive), "--method", "fast", "--strength", "1.2", "--force", "--json", *SMALL])
        == 0
    )
    told = capsys.readouterr()
    level = json.loads(told.out)["level"]
    assert level["too_loud"]
    assert level["comes"] < 0.8
    assert "use --strength" in told.err
    assert run(["info", str(drive), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["level"] == level
