"""The names that others rely on, what importing them costs, and the tape recorder in Python."""

import builtins
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import midair

NAMES = {
    "classes": "Acoustics AmplitudeFrames Calibration ControlGrid Drive Medium PressureFrames Recording SensorGrid "
    "Settings Solution TransducerArray",
    "functions": "calibrate compare live load load_calibration loop open_rig open_take open_tracker play prepare "
    "propagate record save solve",
    "modules": "calibration correct datasets devices dsp errors evaluate figures files model paper patterns physics "
    "pipeline recordings rig settings solvers studio study sweep targets view",
}


def test_the_package_has_these_names_and_no_others():
    expected = sorted(["__version__", *" ".join(NAMES.values()).split()])
    assert sorted(midair.__all__) == dir(midair) == expected


def test_functions_have_help():
    functions = {name: getattr(midair, name) for name in NAMES["functions"].split()}
    assert all(map(inspect.isfunction, functions.values()))
    assert [name for name, one in functions.items() if "Parameters" not in (inspect.getdoc(one) or "")] == []


def modules_after(code):
    """Names of the modules that a fresh Python has loaded after some code."""
    command = [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def test_import_loads_nothing_heavy():
    heavy = "scipy h5py matplotlib pandas soundfile rich pydantic cyclopts numba numpy"
    assert set(heavy.split()).isdisjoint(modules_after("import midair"))


SOLVED = """
import midair
from midair.model import Placement
take, array = midair.record("virtual:towel", 0.05), Placement.grid(columns=1, rows=1).array()
midair.solve(midair.prepare(midair.calibrate(take.recording, take.calibration), mapping="slow-bias"), array)
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("use", "without"),
    [
        ("", {"scipy.spatial", "scipy.sparse", "scipy.linalg", "scipy.signal", "matplotlib"}),
        ("import scipy.fft; load_profiles(); f = Settings(); f.from_plain(f.plain())", {"numpy.f2py", "pydantic"}),
        (SOLVED, {"scipy.fft", "scipy.special", "scipy.ndimage", "scipy.linalg", "scipy.spatial"}),
    ],
)
def test_a_command_starts_without_the_large_parts_of_others(use, without):
    """They take a quarter of the time in which a command starts."""
    names = "from midair.cli.commands import solve_app; from midair.files import load_profiles"
    assert without.isdisjoint(modules_after(f"{names}; from midair.settings import Settings; {use}"))


@pytest.fixture(scope="module")
def stages():
    """A short result of each stage before the solver."""
    take = midair.record("virtual:towel", 0.05)
    pressure = midair.calibrate(take.recording, take.calibration)
    array = midair.TransducerArray.autd3(columns=1, rows=1)
    return {
        **{"midair": midair, "np": np, "take": take, "rec": take.recording, "cal": take.calibration},
        **{"pressure": pressure, "target": midair.prepare(pressure), "array": array},
    }


MISTAKES = Path(__file__).with_name("mistakes_python.txt").read_text(encoding="utf-8").split("\n\n# ")[1:]


def test_a_mistake_names_what_came_and_the_next_step(stages):
    wrong = []
    for rows in MISTAKES:
        names = dict(stages)
        for row in rows.splitlines()[1:]:
            if not re.match(r"\w+Error \| ", row):
                exec(row, names)
                continue
            error, _, rest = row.partition(" | ")
            call, _, words = rest.rpartition(" | ")
            kind = getattr(midair.errors, error, None) or getattr(builtins, error)
            try:
                eval(call, names)
            except kind as refused:
                if not re.search(".*".join(map(re.escape, words.split(" ... "))), str(refused)):
                    wrong.append((call, str(refused)))
            else:
                wrong.append((call, "not refused"))
    assert wrong == []


@pytest.mark.long
def test_python_gives_what_the_commands_give(tmp_path, monkeypatch, capsys):
    from midair.cli import run

    monkeypatch.chdir(tmp_path)
    take = midair.record("virtual:towel", 0.5, path="take.h5")
    pressure = midair.calibrate(take.recording, take.calibration).cut(0.4, 0.05)
    with midair.open_rig("virtual") as rig:
        solution = midair.solve(midair.prepare(pressure), midair.TransducerArray.autd3())
        close = midair.compare(pressure, midair.play(solution, rig))
    for line in ("solve take.h5 --start-at 0.4s --duration 0.05s", "play take.drive.h5"):
        assert run(line.split()) == 0
    drive = midair.load("take.drive.h5").drive
    assert (drive.frames, drive.rate, drive.acoustics) == (solution.drive.frames, 4000.0, solution.drive.acoustics)
    capsys.readouterr()
    assert run(["compare", "take.h5", "take.rerecorded.h5", "--json"]) == 0
    printed = {name: figure["value"] for name, figure in json.loads(capsys.readouterr().out)["figures"].items()}
    # A part that is cut before it is resampled differs a little at its ends.
    assert printed["correlation"] == pytest.approx(close.correlation, abs=1e-3)
    assert printed["gain"] == pytest.approx(close.gain, abs=0.01)
    assert close.correlation > 0.99
