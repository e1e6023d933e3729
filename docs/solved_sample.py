"""Solve the sample that comes solved with midair: `python docs/solved_sample.py` (a quarter of a minute of CPU).

Of three periods, one is kept without the lead: that across whose ends the phases change least.
"""

import tempfile
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.files import load_solution, save
from midair.model import TransducerArray, frames_without_lead
from midair.rig import pressure_to_solve, solve_to_file
from midair.settings import MODES
from midair.studio.solved_sample import PERIOD, STORED, copy_frames, orbit


def solve_period(path: Path = STORED) -> None:
    """Solve the sample and write one period of its drive, which begins with that of the recording."""
    settings = MODES["best"]()
    with tempfile.TemporaryDirectory() as folder:
        take, solved = Path(folder) / "take.h5", Path(folder) / "take.drive.h5"
        save(orbit(3), take)
        solve_to_file(pressure_to_solve(take, settings), TransducerArray.autd3(), settings, solved)
        drive = load_solution(solved).drive
        begin = frames_without_lead(drive.provenance, drive.frames, drive.rate).start
        frames = round(PERIOD * drive.rate)
        # Not near the lead, beside which the drive differs.
        first = min(range(begin + frames // 2, begin + 3 * frames // 2), key=lambda i: seam(drive.phase, i, i + frames))
        copy_frames(solved, path, first + (np.arange(frames) - (first - begin)) % frames, np.ones(frames))


def seam(phase: Array, first: int, end: int) -> float:
    """Mean change of the phases in rad from the last of some frames to the first."""
    return float(np.abs(np.angle(np.exp(1j * (phase[first] - phase[end - 1])))).mean())


if __name__ == "__main__":
    solve_period()
