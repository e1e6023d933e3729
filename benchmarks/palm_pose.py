"""Palms that are not where a drive was solved for: `python -m benchmarks.palm_pose`, recordings in ../shared/data.

`table`: signal to distortion in dB of the pressure on the 16 cells, with one gain, against the target, for a palm that
lies elsewhere: as it is, steered to its centre, steered to the place of the pressure, and solved again for that palm.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.clock import load
from benchmarks.real_objects import takes
from midair.model import Acoustics, Drive, PalmPath
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.physics import (
    aims_of,
    array_from_palm,
    cell_weights,
    middle_of,
    on_the_palm,
    poses_at,
    radiation_pressure,
    steering_phase,
    transfer_matrix,
)
from midair.pipeline import reproduce, required_lead
from midair.rig import VirtualRig
from midair.settings import Settings, best_mode, paper_mode
from midair.solvers import Fast, one_blas_thread
from midair.targets import add_lead

HERE = Path(__file__).parents[1].parent / "shared" / "data"
ROOM = Acoustics(medium=best_mode().acoustics.medium)
MODES: Mapping[str, Settings] = {"best": best_mode(), "paper": paper_mode().but(acoustics=ROOM, method=Fast())}
POSES: Mapping[str, tuple[tuple[float, float, float], float, float]] = {
    "solved": ((0, 0, 0), 0, 0),
    "5 up": ((0, 0, 5), 0, 0),
    "10 up": ((0, 0, 10), 0, 0),
    "20 up": ((0, 0, 20), 0, 0),
    "5 aside": ((5, 0, 0), 0, 0),
    "10 aside": ((10, 0, 0), 0, 0),
    "20 aside": ((20, 0, 0), 0, 0),
    "mixed": ((15, -10, 15), 0, 0),
    "tilt 10": ((0, 0, 0), 10, 0),
    "tilt 20": ((0, 0, 0), 20, 0),
    "turn 10": ((0, 0, 0), 0, 10),
    "turn 30": ((0, 0, 0), 0, 30),
    "all": ((10, 5, 10), 10, 10),
}
"""Offset in mm, tilt about y and rotation about z in degrees."""


def pose(offset: tuple[float, float, float], tilt: float, turn: float, solved: NDArray[np.float64]) -> PalmPath:
    """One pose of a palm."""
    a, b = np.radians(tilt), np.radians(turn)
    about_y = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    about_z = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    R = about_y @ about_z
    return PalmPath(
        time=np.zeros(1),
        centre=(solved + 1e-3 * np.array(offset))[None],
        normal=-R[None, :, 2],
        fingers=R[None, :, 1],
        confidence=np.ones(1),
    )


def ratio(wanted: NDArray[np.float64], got: NDArray[np.float64]) -> float:
    """Signal to distortion in dB of what changes, with one gain."""
    wanted, got = (each - each.mean(axis=0) for each in (wanted, got))
    gain = (wanted * got).sum() / (got**2).sum()
    return float(10 * np.log10((wanted**2).sum() / ((wanted - gain * got) ** 2).sum()))


def table(things: Sequence[str], names: Sequence[str], plan: FidelityPlan, *, again: bool) -> None:
    for mode in MODES:
        print(f"\n{mode} mode\n| | {' | '.join(names)} |\n{'|---' * (len(names) + 1)}|", flush=True)
        for thing in things:
            rows(thing, MODES[mode], names, plan, again=again)


def rows(thing: str, settings: Settings, names: Sequence[str], plan: FidelityPlan, *, again: bool) -> None:
    rig = plan.rig
    original = original_of(thing, plan, settings)
    settings = at_strength(original, settings, plan)
    lead = required_lead(settings)
    asked = add_lead(original, lead)
    made = reproduce(asked, rig.array, settings)
    grid = settings.target.grid
    solved = middle_of(grid)
    rig = replace(rig, cells=original.sensor)
    skin = rig.skin()
    weights = cell_weights(rig.sensor_model, skin.points, between="waves")
    drawn = cell_weights(rig.sensor_model, grid, between="lines")
    piece = slice(round(lead * settings.target.rate), -round(lead * settings.target.rate) or None)
    wanted = (radiation_pressure(made.target.amplitude, ROOM.medium) @ drawn.T)[piece]

    def felt(drive: Drive, at: PalmPath, extra: NDArray[np.float64] | float = 0.0) -> float:
        G = transfer_matrix(on_the_palm(skin.points.position, solved, at)[0], rig.array, acoustics=ROOM)
        q = (drive.q * np.exp(1j * np.asarray(extra)))[piece].astype(np.complex64)
        return ratio(wanted, np.abs(q @ G.T.astype(np.complex64)) ** 2 @ weights.T)

    drive = made.solution.drive
    aims = aims_of(drive, grid)
    found: dict[str, list[float]] = {"as it is": [], "centre": [], "aimed": [], **({"again": []} if again else {})}
    for name in names:
        at = pose(*POSES[name], solved)
        found["as it is"].append(felt(drive, at))
        found["centre"].append(felt(drive, at, steering_phase(rig.array, ROOM.medium, solved, at)))
        many = poses_at(at, np.arange(len(aims), dtype=float))
        found["aimed"].append(felt(drive, at, steering_phase(rig.array, ROOM.medium, solved, many, aim=aims)))
        if again:
            other = reproduce(asked, array_from_palm(rig.array, solved, at), settings).solution.drive
            found["again"].append(felt(other, at))
    for name, each in found.items():
        print(f"| {Path(thing).stem}, {name} | {' | '.join(f'{one:.1f}' for one in each)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.palm_pose", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=HERE, help="folder with the recordings")
    parser.add_argument("--things", nargs="+", default=["towel", "brush", "sponge", "denim", "hapmat-fabric"])
    parser.add_argument("--poses", nargs="+", choices=POSES, default=list(POSES))
    parser.add_argument("--again", action="store_true", help="solve again for each pose, which takes minutes")
    parser.add_argument("--duration", type=float, default=0.1, help="duration of the signals in s (default 0.1)")
    options = parser.parse_args()
    print(load())
    plan = FidelityPlan(strength=0.15, duration=options.duration, rig=VirtualRig(acoustics=ROOM))
    with one_blas_thread(), TemporaryDirectory() as folder:
        files = {Path(each).stem: each for each in takes(options.data, Path(folder))} if options.data.is_dir() else {}
        things = [str(files.get(thing, thing)) for thing in options.things]
        table(things, options.poses, plan, again=options.again)


if __name__ == "__main__":
    main()
