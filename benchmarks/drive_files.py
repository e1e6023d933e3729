"""Size of drive files, time to write and read them, and what the units play (`python -m benchmarks.drive_files`)."""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.clock import timed
from midair.devices import intensity_bytes, phase_bytes
from midair.files import load_solution, save_solution
from midair.paper import FidelityPlan
from midair.paper.modes_compared import at_strength, original_of
from midair.pipeline import reproduce, required_lead
from midair.settings import best_mode
from midair.solvers import one_blas_thread
from midair.targets import add_lead


def main() -> None:
    """Print one row for each thing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--things", nargs="*", default=["towel", "noise"], help="or files of recordings")
    parser.add_argument("--duration", type=float, default=0.5, help="s of each, beside its lead")
    options = parser.parse_args()
    with one_blas_thread(), TemporaryDirectory() as folder:
        for thing in options.things:
            print(row(thing, options.duration, Path(folder) / "a.drive.h5"), flush=True)


def row(thing: str, duration: float, path: Path) -> str:
    """Figures of one thing in words."""
    settings, plan = best_mode(), FidelityPlan(duration=duration)
    original = original_of(thing, plan, settings)
    made = reproduce(add_lead(original, required_lead(settings)), plan.rig.array, at_strength(original, settings, plan))
    drive = made.solution.drive
    plain = drive.phase.nbytes + drive.level.nbytes + made.target.amplitude.nbytes
    _, writing = timed(lambda: save_solution(made.solution, path, target=made.target))
    again, reading = timed(lambda: load_solution(path).drive)
    units = len(np.unique(drive.array.unit))
    same = all(np.array_equal(each(again, units), each(drive, units)) for each in (phase_bytes, intensity_bytes))
    seconds, size = drive.frames / drive.rate, path.stat().st_size
    return (
        f"{Path(thing).stem}: {drive.frames} frames; {size / 1e6:.2f} MB, {size / 1e6 / seconds:.2f} MB a second, "
        f"{100 * size / plain:.1f} % of float64; written in {1e-3 * writing:.2f} s of CPU, read in "
        f"{1e-3 * reading:.2f} s; bytes of the units {'equal' if same else 'DIFFERENT'}"
    )


if __name__ == "__main__":
    main()
