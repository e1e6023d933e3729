"""Ctrl-C at the last moment of a command that writes: one line, status 130, nothing half-written.

At the first step of a bar it is in test_long_work.py.
"""

import shutil
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest

from midair.cli import run
from midair.files import atomic, save
from midair.model import Calibration, Recording, SensorGrid

QUICK = "--mode paper --points 6 --pitch 11mm --iterations 2 1 --duration 0.03s"

AT_THE_END = {
    "import song.wav song.h5": "nothing was written",
    "import sample:denim denim.h5 --peak 30Pa": "nothing was written",
    "export take.h5 take.csv": "nothing was written",
    "cut take.h5 part.h5 --start 0.1s": "nothing was written",
    "trim take.h5 part.h5": "nothing was written",
    "join take.h5 take.h5 both.h5": "nothing was written",
    "gain take.h5 loud.h5 --by 2": "nothing was written",
    "mask take.h5 masked.h5 --channels 3": "nothing was written",
    "resample take.h5 slow.h5 --rate 500Hz": "nothing was written",
    f"solve take.h5 {QUICK}": "nothing was written",
    "exposure take.drive.h5 --figure loud.png": "nothing was written",
}
"""Commands that write, stopped when the file is whole and has not got its name."""


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("desk")
    grid = SensorGrid()
    noise = 0.05 * np.random.default_rng(0).standard_normal((300, *grid.shape))
    take = Recording(samples=noise, rate=1000.0, unit="V", sensor=grid)
    save(take, folder / "take.h5", calibration=Calibration.flat(grid, sensitivity=0.02))
    save(
        Recording(samples=noise[:, :1, :1], rate=1000.0, unit="Pa", sensor=SensorGrid(rows=1, columns=1)),
        folder / "song.wav",
    )
    with chdir(folder):
        assert run(["solve", "take.h5", *QUICK.split()]) == 0
    return folder


@pytest.fixture
def folder(desk, tmp_path):
    shutil.copytree(desk, tmp_path, dirs_exist_ok=True)
    return tmp_path


def stopped(line, capsys):
    """Last line of the command; only the kept files remain."""
    before = set(Path().rglob("*"))
    if "take.drive.h5" not in line and "solve" in line:
        Path("take.drive.h5").unlink()
        before -= {Path("take.drive.h5")}
    capsys.readouterr()
    assert run(line.split()) == 130
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("midair: stopped; "), said
    new = {path for path in set(Path().rglob("*")) - before if path.is_file()}
    assert new == {Path(name) for name in said.partition("kept ")[2].split(", ") if name}
    return said.removeprefix("midair: stopped; ")


@pytest.mark.parametrize("line", AT_THE_END)
def test_stopped_at_the_last_moment(line, folder, capsys, monkeypatch):
    def stop(old, new):
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic.os, "replace", stop)
    assert stopped(line, capsys) == AT_THE_END[line]
