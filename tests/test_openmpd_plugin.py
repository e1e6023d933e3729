"""The package plugins/midair-openmpd, installed: its own tests, which include the contract of every array."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "plugins" / "midair-openmpd"


@pytest.mark.long
def test_its_tests_pass_beside_this_midair(tmp_path):
    pytest.importorskip("hatchling")
    pytest.importorskip("serial")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install", "--no-deps"]
    subprocess.run([*pip, "--no-build-isolation", "--target", tmp_path, FOLDER], check=True)
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "pytest", "-q", "-c", "pyproject.toml", "--rootdir", ".", "-m", "not slow"]
    run = subprocess.run(
        [*command, FOLDER / "tests"], cwd=ROOT, env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout[-4000:] + run.stderr[-1000:]
    assert " passed" in run.stdout
