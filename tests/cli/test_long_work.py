"""Every command that may work longer than two seconds: its bars have an end, and Ctrl-C prints what was kept.

Ctrl-C comes at the first step of a bar, and when the file is whole and has not got its name.
"""

import re
import shutil
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import soundfile
from rich.progress import Progress

from midair.cli import run
from midair.files import atomic, save
from midair.model import Calibration, Recording, SensorGrid
from midair.progress import report_to

QUICK = "--mode paper --method fast --set target.grid={rows=6,columns=6,pitch=0.011} --lead 0s --duration 0.03s"
OPTIONS = {"QUICK_ALONE": QUICK.replace("--lead 0s ", ""), "QUICK": QUICK}
ROWS = Path(__file__).with_name("long_work.txt").read_text(encoding="utf-8")
for name, options in OPTIONS.items():
    ROWS = ROWS.replace(f" {name} |", f" {options} |")
LINES = dict(row.split(" | ") for row in ROWS.splitlines() if row and not row.startswith("#"))
"""Command lines, and their message after Ctrl-C at the first progress bar."""

SLOW = "paper figures --figure 4|calibrate beam|calibrate array"
"""Beginnings of those whose whole run takes minutes."""

FAST = "import song.csv|info take.drive.h5"
"""Beginnings of a reader and an inspection, which are fast tests."""

AT_ONCE = "import song.wav|cut|trim|join|gain|mask|resample|export take.h5 take.mat"
"""Beginnings of those without a bar, since a recording is read at once."""

OWN_BARS = "calibrate (b|array)|draw|solve|play|loop|budget|compare|demo|paper|sweep (p|rec)"
"""Beginnings of those that show bars, which have an end; the others show the elapsed time."""

WRITING = "import song.wav|export take.h5 take.csv|trim|join|gain|mask|resample|solve|expo"
"""Beginnings of some that write a file, beside `cut`."""


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("long")
    with chdir(folder):
        grid, rng = SensorGrid(), np.random.default_rng(0)
        noise = 0.05 * rng.standard_normal((300, *grid.shape))
        take = Recording(samples=noise, rate=1000.0, unit="V", sensor=grid)
        save(take, "take.h5", calibration=Calibration.flat(grid, sensitivity=0.02))
        Path("circle.toml").write_text("[[spot]]\nshape = 'circle'\ndraw_hz = 50", encoding="utf-8")
        soundfile.write("song.wav", noise.reshape(300, -1), 1000, subtype="FLOAT")
        pair = SensorGrid(rows=1, columns=2)
        same = np.repeat(0.05 * rng.standard_normal((12_000, 1, 1)), 2, axis=2)
        save(Recording(samples=same + 1e-4 * rng.standard_normal(same.shape), rate=1000.0, sensor=pair), "long.h5")
        table = np.column_stack([np.arange(300) / 1000, noise.reshape(300, -1)])
        names = ",".join(["time [s]", *(f"c{number}" for number in range(16))])
        np.savetxt("song.csv", table, delimiter=",", header=names, comments="")
        assert run(["solve", "take.h5", *QUICK.split()]) == 0
        assert run(["study", "new", "touch", "--drives", "none", "--participants", "2"]) == 0
        assert run(["study", "run", "touch", "--simulate"]) == 0
    return folder


def files_here():
    return {path: path.stat().st_mtime_ns for path in Path().rglob("*") if path.is_file()}


def check_stopped(line, capsys):
    """Run a command that Ctrl-C stops: one line, and nothing but the files that it names is new or changed."""
    before = files_here()
    assert run(line.split()) == 130
    said = [each for each in capsys.readouterr().err.splitlines() if each.startswith("midair: ")]
    assert said == [f"midair: stopped; {LINES[line]}"]
    kept = {Path(name) for name in LINES[line].partition("kept ")[2].split(", ") if name}
    # A sweep keeps its results.
    ours = {path for path in files_here() if not {".sweep", ".report"} & {each.suffix for each in path.parents}}
    assert ours - set(before) == kept
    assert {path: when for path, when in files_here().items() if path in before} == before


def ctrl_c_at_the_first_step_of_a_bar_prints_the_kept_files(line, capsys, patch):
    begin, begun = Progress.add_task, []

    def add_task(self, description, **more):
        # Recorded frames are kept.
        if description != "record":
            begun.append(description)
            raise KeyboardInterrupt
        return begin(self, description, **more)

    def report(done, total):
        begun.append(total)
        raise KeyboardInterrupt

    patch.setattr(Progress, "add_task", add_task)
    with report_to(report):
        check_stopped(line, capsys)
    assert begun


def ctrl_c_at_the_last_moment_leaves_nothing(line, capsys, patch):
    def stop(old, new):
        raise KeyboardInterrupt

    patch.setattr(atomic.os, "replace", stop)
    check_stopped(line, capsys)


def a_bar_has_an_end(line, capsys, patch):
    """So that it shows the time left: every task of every bar states how much there is in all."""
    ends, finish = [], Progress.stop

    def stop(self):
        ends.extend((task.description, task.total) for task in self.tasks)
        finish(self)

    patch.setattr(Progress, "stop", stop)
    assert run(line.split()) == 0, capsys.readouterr().err
    assert ends
    assert [name for name, total in ends if total is None] == []


def begin(these, but="$"):
    return [line for line in LINES if re.match(these, line) and not re.match(but, line)]


CASES = [
    (ctrl_c_at_the_first_step_of_a_bar_prints_the_kept_files, begin(FAST), ()),
    (ctrl_c_at_the_first_step_of_a_bar_prints_the_kept_files, begin("", f"{FAST}|{AT_ONCE}"), pytest.mark.long),
    (ctrl_c_at_the_last_moment_leaves_nothing, begin("cut"), ()),
    (ctrl_c_at_the_last_moment_leaves_nothing, begin(WRITING), pytest.mark.long),
    *((a_bar_has_an_end, begin(OWN_BARS, SLOW)[part::2], pytest.mark.long) for part in range(2)),
    (a_bar_has_an_end, begin(SLOW), pytest.mark.slow),
]


@pytest.mark.parametrize(("holds", "lines"), [pytest.param(*case, marks=mark) for *case, mark in CASES])
def test_each_line(holds, lines, desk, tmp_path, capsys, monkeypatch, subtests):
    for number, line in enumerate(lines):
        monkeypatch.chdir(shutil.copytree(desk, tmp_path / str(number)))
        if line.startswith("sweep report"):
            assert run(["sweep", "patterns", "done.sweep", "--count", "4", "--workers", "1", "--strength", "0.1"]) == 0
        capsys.readouterr()
        with subtests.test(line), monkeypatch.context() as patch:
            holds(line, capsys, patch)
