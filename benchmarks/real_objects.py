"""Recordings from public data sets: `python -m benchmarks.real_objects`, with the data in ../shared/data or --data.

Recordings with a low rate are sped up to 1 kHz, and one channel becomes a field through a disc of 20 mm that moves at
50 mm/s; both are printed. `fidelity`: one recording of each collection in the paper's and the best mode, on nominal
transducers and on transducers with individual resonance, quality factor and strength, as in `midair paper --fidelity`
with files; the paper's mode is solved as a whole. `materials`: strokes over seven fabrics, as in
`python -m benchmarks.materials --recordings FOLDER`.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.clock import load, timed
from benchmarks.materials import MaterialsPlan, print_materials
from benchmarks.places import ratio_at
from midair.files import open_take, save
from midair.model import Calibration, Recording
from midair.paper import FidelityPlan, fidelity_table
from midair.paper.modes_compared import at_strength, original_of
from midair.physics import PlaybackChain, Transducers
from midair.pipeline import reproduce, required_lead
from midair.recordings import Footprint, footprint_field
from midair.settings import paper_mode
from midair.solvers import one_blas_thread
from midair.targets import add_lead

_FOLDERS = [above / "shared" / "data" for above in Path(__file__).parents[1:]]
DATA = next((folder for folder in _FOLDERS if folder.is_dir()), _FOLDERS[0])
"""Folder with fabricslide, hapmat and audio-to-tactile."""
RATE = 1000.0
"""Rate in Hz to which recordings of a lower rate are sped up."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real_objects", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder with fabricslide, hapmat and audio-to-tactile")
    parser.add_argument("--part", choices=("fidelity", "materials"), nargs="*", default=["fidelity", "materials"])
    options = parser.parse_args()
    print(load())
    with one_blas_thread(), TemporaryDirectory() as folder:
        if "fidelity" in options.part:
            fidelity(takes(options.data, Path(folder)))
        if "materials" in options.part:
            materials(options.data, Path(folder))


def takes(data: Path, folder: Path) -> list[str]:
    """One calibrated recording of each collection, as files."""
    denim = fast(open_take(data / "fabricslide" / "fabric" / "Denim_F180_V-50mmps_0.csv").recording)
    stick = fast(open_take(data / "hapmat" / "Fabric 1.csv", channels=["accel_z"], unit="count").recording)
    effect = open_take(data / "audio-to-tactile" / "tactile_pattern_connect.wav", unit="count").recording
    moved = Footprint(turn="back")
    made = {
        "denim": denim,
        "hapmat-fabric": footprint_field(stick, moved),
        "connect": footprint_field(effect, moved),
    }
    return [str(kept(recording, folder / f"{name}.h5")) for name, recording in made.items()]


def fast(recording: Recording) -> Recording:
    """Change the rate to 1 kHz."""
    print(f"{recording.provenance.source}: {RATE / recording.rate:.1f} times as fast")
    return replace(recording, rate=RATE)


def kept(recording: Recording, path: Path) -> Path:
    """Save a recording with a calibration that makes its largest change 30 Pa."""
    samples = np.asarray(recording.samples, float)
    change = float(np.abs(samples - np.median(samples, axis=0)).max())
    flat = Calibration.flat(recording.sensor, sensitivity=change / 30, unit=recording.unit)
    save(recording, path, calibration=flat)
    return path


def fidelity(things: list[str]) -> None:
    """Print the table of `midair paper --fidelity`, and the fidelity on the skin with nominal transducers."""
    plan = FidelityPlan(things=tuple(things), paper=paper_mode().but(method="glide"), passes=0)
    rows = iter(fidelity_table(plan).rows)
    for thing in things:
        for settings in plan.modes.values():
            row = next(rows)
            original = original_of(thing, plan, settings)
            alike = at_strength(original, settings, plan)
            asked = add_lead(original, required_lead(alike))
            rig = replace(plan.rig, cells=original.sensor)
            made, cost = timed(lambda rig=rig, asked=asked, alike=alike: reproduce(asked, rig.array, alike))
            drive = made.solution.drive
            chain = PlaybackChain(transducers=Transducers.alike(drive.array.count))
            at = replace(plan, rig=rig)
            nominal = ratio_at(original, asked, drive, alike, at, chain, (0.0, 0.0))
            print(
                f"{row['signal']:14} {row['mode']:6} skin {nominal:5.1f} dB on nominal transducers, "
                f"{row['sdr_on_skin_db']:5.1f} dB on individual ones, re-recorded {row['sdr_rerecorded_db']:5.1f} dB, "
                f"leak {100 * row['leak']:4.0f} %, solved in "
                f"{cost / 1e3 / (asked.frames / asked.rate):.1f} s of CPU per second",
                flush=True,
            )


def materials(data: Path, folder: Path) -> None:
    """Print the classification of seven fabrics at 50 mm/s, with three to six strokes each."""
    below = folder / "fabrics"
    below.mkdir()
    for path in sorted((data / "fabricslide" / "fabric").glob("*50mmps_?.csv")):
        kept(fast(open_take(path).recording), below / f"{path.stem}.h5")
    print_materials(MaterialsPlan(folder=below))


if __name__ == "__main__":
    main()
