"""The names that others rely on, and what importing them costs."""

import subprocess
import sys

import pytest

import midair


def test_import_loads_nothing_heavy():
    heavy = {
        "scipy",
        "scipy.signal",
        "h5py",
        "matplotlib",
        "pandas",
        "soundfile",
        "rich",
        "pydantic",
        "cyclopts",
        "numba",
    }
    code = "import sys, midair; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "numpy" in loaded
    assert heavy.isdisjoint(loaded)


def test_the_commands_and_studies_start_without_pandas():
    code = "import sys, midair.cli, midair.study; print('pandas' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "False"


@pytest.mark.parametrize("name", ["load", "save", "calibrate", "prepare", "solve", "propagate", "compare"])
def test_verbs_are_functions_whatever_was_imported_before(name):
    code = f"import midair.solvers, midair.calibration, midair.targets, midair; print(callable(midair.{name}))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "True"


def test_nouns_and_laws_are_there():
    assert callable(midair.physics.transfer_matrix)
    assert callable(midair.study.rm_anova)
    assert {"TransducerArray", "SensorGrid", "ControlGrid", "Medium", "Recording"} <= set(midair.model.__all__)
