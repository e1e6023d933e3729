"""The sample that comes solved: a spot that circles and buzzes; one period of its drive is part of the package.

``python docs/solved_sample.py`` solves it again.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.files import load_solution, load_target, save, save_solution
from midair.model import PressureFrames, Provenance, Recording, SensorGrid
from midair.pipeline import required_lead
from midair.settings import MODES
from midair.targets import add_lead

SOLVED = "orbit"
STORED = Path(__file__).with_name(f"{SOLVED}.drive.h5")

PERIOD, TIMES = 0.2, 3
"""Duration of a period in s, and periods of the sample."""


def orbit(times: int = TIMES) -> Recording:
    """Pressure of a spot of 18 mm that goes round once a period and vibrates at 160 Hz, at most 60 Pa."""
    rate, sensor = 1000.0, SensorGrid()
    time = np.arange(round(times * PERIOD * rate))[:, None, None] / rate
    turn = 2 * np.pi * time / PERIOD
    beside = (sensor.x - 9e-3 * np.cos(turn)) ** 2 + (sensor.y[:, None] - 9e-3 * np.sin(turn)) ** 2
    pressure = 30 * (1 + np.sin(2 * np.pi * 160 * time)) * np.exp(-beside / (2 * 9e-3**2))
    life = Provenance(source=f"virtual:{SOLVED}", simulated=True, notes={"object": SOLVED})
    return Recording(samples=pressure, rate=rate, sensor=sensor, unit="Pa", provenance=life)


def write_sample(folder: Path) -> None:
    """Write the recording and its drive into a folder: the stored period, repeated, with a lead."""
    solution = load_solution(STORED)
    rate, period, seconds = solution.drive.rate, solution.drive.frames, required_lead(MODES["best"]())
    touch = PressureFrames(pressure=np.ones((TIMES * period, 1, 1)), rate=rate, sensor=SensorGrid(rows=1, columns=1))
    share = add_lead(touch, seconds).pressure.ravel()
    lead = (len(share) - touch.frames) // 2
    chosen = np.clip(np.arange(len(share)) - lead, 0, touch.frames - 1) % period
    copy_frames(STORED, folder / STORED.name, chosen, share)
    save(orbit(), folder / f"{SOLVED}.h5")


def copy_frames(source: Path, path: Path, frames: NDArray[np.intp], share: Array) -> None:
    """Save chosen frames of a drive with its target, each at a share of its pressure."""
    solution, target, loud = load_solution(source), load_target(source), np.sqrt(share)
    drive = solution.drive
    kept = replace(
        solution,
        drive=replace(drive, phase=drive.phase[frames], level=drive.level[frames] * loud),
        error=solution.error[frames],
        iterations=solution.iterations[frames],
        status=tuple(solution.status[frame] for frame in frames),
    )
    save_solution(kept, path, target=target and replace(target, amplitude=target.amplitude[frames] * loud[:, None]))
