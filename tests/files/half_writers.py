"""Run every writer of midair and let the kernel stop it half way; started by tests.

The argument "quick" leaves out writers that take seconds. Each writer runs once to measure its largest file, and then
twice in a separate process with a file size limit of half of that: with an error (EFBIG), and killed (by SIGXFSZ),
which leaves more files behind. Prints a line of JSON for each.
"""

import json
import os
import resource
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
from pandas import DataFrame

from midair import files
from midair.calibration import calibrate
from midair.cli import run
from midair.errors import FileError
from midair.model import (
    Acoustics,
    Calibration,
    Drive,
    Provenance,
    Recording,
    SensorGrid,
    SensorWiring,
    Solution,
    TransducerArray,
)
from midair.rig import Subject, store_subject
from midair.settings import MODES
from midair.study import StudyFolder, read_design, template_text
from midair.study.tables import write_csv

GRID = SensorGrid()
RNG = np.random.default_rng(1)
LIFE = Provenance(source="bench", notes={"object": "towel " * 20})
TAKE = Recording(samples=RNG.normal(size=(3000, 4, 4)), rate=1000, sensor=GRID, unit="V", provenance=LIFE)
FLAT = Calibration.flat(GRID)
PRESSURE = calibrate(TAKE, FLAT)
DESIGN = read_design(template_text("paper"), name="touch", participants=2, seed=1)
TABLE = DataFrame({"participant": [f"sub-{n:02d}" for n in range(400)], "answer": ["towel"] * 400})
ARRAY = TransducerArray.autd3(columns=1, rows=1)
DRIVE = Drive(
    phase=RNG.uniform(-3, 3, (20, ARRAY.count)),
    level=RNG.random(20),
    rate=1000,
    array=ARRAY,
    acoustics=Acoustics(),
    provenance=LIFE,
)
SOLUTION = Solution(drive=DRIVE, error=RNG.random(20), iterations=np.full(20, 5), status=("converged",) * 20)


def with_pressure(path):
    files.save(TAKE, path, calibration=FLAT, pressure=PRESSURE)


def study_new(path):
    StudyFolder.create(path, template_text("paper"), DESIGN)


def with_answers(folder):
    study = folder / "study"
    assert run(["study", "new", str(study), "--participants", "2", "--drives", "none"]) == 0
    assert run(["study", "run", str(study), "--simulate"]) == 0
    return study


def command(*words):
    if run([str(word) for word in words]):
        raise FileError("said above")


WRITERS = {
    **{
        f"a{ending}": lambda path: files.save(TAKE, path, calibration=FLAT)
        for ending in (".h5", ".csv", ".wav", ".npz", ".mat")
    },
    "pressed.h5": with_pressure,
    "a.calibration.h5": lambda path: files.save_calibration(FLAT, path),
    "a.drive.h5": lambda path: files.save_solution(SOLUTION, path),
    "sensor.toml": lambda path: files.save_sensor(SensorWiring.for_channels(16, name="palm", unit="V"), path),
    "settings.toml": lambda path: MODES["best"]().save(path),
    "answers.csv": lambda path: write_csv(TABLE, path),
    "subject.json": lambda path: store_subject(Subject(object="towel " * 100)),
    "study": study_new,
    "bids": lambda path: command("study", "export", path.parent / "with" / "study", path),
    "report.html": lambda path: command(
        "study", "analyse", path.parent / "with" / "study", "--output", path, "--draws", 200
    ),
}
FOLDERS = ("study", "bids")
LONG = ("bids", "report.html")
NEW_ONLY = ("answers.csv",)
"""Writers that refuse a file that is there."""


def largest(path):
    inside = [each for each in (path.rglob("*") if path.is_dir() else [path]) if each.is_file()]
    return max(each.stat().st_size for each in inside)


def tried(write, path, limit, how):
    """Run a writer in a process with a file size limit of `limit` bytes, and return how it ended."""
    sys.stdout.flush()
    process = os.fork()
    if process:
        return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL if how == "killed" else signal.SIG_IGN)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    status = 0
    try:
        write(path)
    except FileError as wrong:
        status = 1 if "\n" not in str(wrong) else 2
    except BaseException:  # noqa: BLE001  # the process must end here, and its status says how
        status = 3
    os._exit(status)


def main(*quick):
    """Print the files that each writer left, for both ways to stop it."""
    for name, write in WRITERS.items():
        if quick and name in LONG:
            continue
        with tempfile.TemporaryDirectory() as where:
            folder = Path(where)
            os.environ["MIDAIR_STATE"] = where
            path = folder / name
            if name in ("bids", "report.html"):
                (folder / "with").mkdir()
                with_answers(folder / "with")
            write(path)
            limit = largest(path) // 2
            before = _contents(path)
            for how in ("refused", "killed"):
                if name in (*FOLDERS, *NEW_ONLY):
                    _remove(path)
                ended = tried(write, path, limit, how)
                told = {
                    "name": name,
                    "how": how,
                    "ended": ended,
                    "whole": _whole(name, before, _contents(path)),
                    "left": [each.name for each in folder.glob(".midair-*")],
                    "again": name in FOLDERS and tried(write, path, 2**40, how),
                }
                print(json.dumps(told), flush=True)


def _contents(path):
    """Names and bytes of the visible part of a file or folder."""
    every = path.rglob("*") if path.is_dir() else [path]
    return {str(each.relative_to(path)): each.read_bytes() for each in every if each.is_file()}


def _whole(name, before, after):
    """True if the previous content is unchanged."""
    return after == ({} if name in (*FOLDERS, *NEW_ONLY) else before)


def _remove(path):
    for each in sorted(path.rglob("*"), reverse=True) if path.is_dir() else []:
        each.rmdir() if each.is_dir() else each.unlink()
    path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
