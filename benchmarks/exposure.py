"""Errors of the exposure check in both directions: `python -m benchmarks.exposure`.

The parts are: attacks by an optimiser that uses all points and airs of the check, on random places in random airs;
random foci, a third of them on a surface; and the mode quiet under five levels at the ears (only with `--part safe`).
The true level is the sum of all waves at the units' own phase and level steps, maximised over place and air without
code of the check (`benchmarks.exposure_attacks`). Frames are measured alone; `benchmarks.exposure_time` has moments.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.clock import load
from benchmarks.exposure_attacks import (
    ARRAY,
    Seen,
    descended,
    direct_sum,
    played,
    solved,
    somewhere,
    sounding,
    within,
)
from benchmarks.real_objects import DATA, fast, kept
from midair.devices import measure_exposure
from midair.evaluate import budget, felt
from midair.files import open_take, profile_named
from midair.model import Acoustics, Drive, Medium
from midair.paper.modes_compared import FidelityPlan, original_of
from midair.physics import (
    Place,
    airs_of_room,
    focus_phase,
    level_if_unlike,
    searches_of,
    sound_level,
    transfer_matrix,
)
from midair.pipeline import calibrated_pressure, reproduce, required_lead
from midair.rig import BudgetPlan, VirtualRig, record
from midair.rig.correction.budget_stages import stage_outputs
from midair.rig.correction.iteration import no_progress
from midair.rig.names.sensor_names import SPREADS, TransducerSpread
from midair.settings import Settings, best_mode, quiet_mode
from midair.solvers import one_blas_thread
from midair.targets import add_lead

PROFILE = profile_named("occupational-110")
PARTS = ("attacks", "foci")
THINGS = ("towel", "sponge", "denim", "am-i")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exposure", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--part", choices=(*PARTS, "safe"), nargs="*", default=list(PARTS), help="only these parts (default all)"
    )
    parser.add_argument("--foci", type=int, default=3072, help="random foci (default 3072)")
    parser.add_argument("--attacks", type=int, default=102, help="number of attacks, in groups of 6 (default 102)")
    parser.add_argument("--steps", type=int, default=200, help="optimisation steps per attack (default 200)")
    parser.add_argument("--room", type=float, help="air temperature in degrees Celsius (default: unknown)")
    parser.add_argument("--surface", action="store_true", help="attack points on the cube's surface only")
    parser.add_argument("--seed", type=int, default=2026, help="seed of all random numbers (default 2026)")
    parser.add_argument("--data", type=Path, default=DATA, help="folder with fabricslide, for denim")
    parser.add_argument("--things", nargs="*", choices=THINGS, default=THINGS, help="recordings of the part safe")
    parser.add_argument("--levels", type=float, nargs="*", default=[110, 115, 120, 130, 141], help="in dB")
    options = parser.parse_args()
    print(load())
    rng = np.random.default_rng(options.seed)
    room = None if options.room is None else Medium.at(temperature=options.room)
    if "attacks" in options.part:
        attacks(options.attacks, options.steps, rng, room, surface=options.surface)
    if "foci" in options.part:
        foci(options.foci, rng, room)
    if "safe" in options.part:
        with one_blas_thread():
            for thing in options.things:
                safe(thing, options.levels, options.data)


def some_air(rng: np.random.Generator, room: Medium | None) -> Medium:
    """Random air: 15 to 30 degrees, or within 2 degrees of the stated temperature, at any likely humidity."""
    cold, warm = (15.0, 30.0) if room is None else (room.degrees - 2, room.degrees + 2)
    return Medium.at(temperature=rng.uniform(cold, warm), humidity=rng.uniform(0.1, 0.9))


def attacks(count: int, steps: int, rng: np.random.Generator, room: Medium | None, *, surface: bool) -> None:
    """Attack a random point in a random air in four ways, and measure the largest underestimate.

    One begins with the drive that is solved to be loud there and quiet where the check looks, as it is and after
    optimisation; one with a focus, one with random phases, each with and without levels of its own.
    """
    airs = airs_of_room(room, PROFILE.places, ARRAY)
    everything = []
    for place, search in zip(PROFILE.places[:3], searches_of(PROFILE.places, ARRAY, airs).each, strict=False):
        points = search.points
        matrix = np.concatenate([transfer_matrix(points, ARRAY, acoustics=air).astype(np.complex64) for air in airs])
        seen, missed = Seen.of(matrix), {}
        del matrix
        for _ in range(count // 6):
            aims, media = somewhere(place, 2, rng, surface=surface), [some_air(rng, room) for _ in range(2)]
            for aim, medium in zip(aims, media, strict=True):
                wanted = transfer_matrix(aim[None], ARRAY, acoustics=Acoustics(medium=medium))[0]
                best = solved(seen, wanted)
                focus, noise = np.exp(-1j * np.angle(wanted)), np.exp(1j * rng.uniform(0, 2 * np.pi, ARRAY.count))
                starts, target = np.concatenate([best, focus[None], noise[None]]), wanted.astype(np.complex64)
                for way, drive in {
                    "solved": played(np.angle(best), np.abs(best)),
                    "descended, with levels": descended(seen, target, starts, steps, levels=True),
                    "descended, phases": descended(seen, target, starts, steps, levels=False),
                }.items():
                    true = loudest_near(place, aim, drive, medium, room)
                    found = measure_exposure(drive, ARRAY, PROFILE, room=room, alone=True).level
                    found = found[:, PROFILE.places.index(place)]
                    missed.setdefault(way, []).append((true - found).max())
        for way, each in missed.items():
            print(
                f"{len(each)} attacks at the {place.name}, {way}: true minus reported, worst {max(each):+.2f} dB, "
                f"mean {np.mean(each):+.2f} dB",
                flush=True,
            )
        everything += [max(each) for each in zip(*missed.values(), strict=True)]
    print(f"{len(everything)} attacks, the best way of each: worst {max(everything):+.2f} dB")


def loudest_near(
    place: Place, aim: NDArray[np.float64], drive: Drive, medium: Medium, room: Medium | None
) -> NDArray[np.float64]:
    """Level of each frame in dB, maximised over 5 x 5 x 5 points of 4 mm around a point and over 5 airs around one."""
    cold, warm = (15.0, 30.0) if room is None else (room.degrees - 2, room.degrees + 2)
    points, found = np.concatenate([aim[None], within(place, aim[None], 2e-3, 5)]), []
    for change in (-1.0, -0.5, 0.0, 0.5, 1.0):
        near = Medium.at(temperature=float(np.clip(medium.degrees + change, cold, warm)), humidity=medium.humidity)
        found.append(direct_sum(sounding(drive), points, near).max(axis=0))
    return sound_level(np.max(found, axis=0))


def foci(count: int, rng: np.random.Generator, room: Medium | None) -> None:
    for number, place in enumerate(PROFILE.places[:3]):
        over = []
        for _ in range(0, count // 3, 512):
            points, air = somewhere(place, 512, rng), some_air(rng, room)
            phase = np.stack([focus_phase(ARRAY, point, acoustics=Acoustics(medium=air)) for point in points])
            drive = played(phase)
            true = np.concatenate(
                [loudest_near(place, point, _frame(drive, row), air, room) for row, point in enumerate(points)]
            )
            over.append(measure_exposure(drive, ARRAY, PROFILE, room=room, alone=True).level[:, number] - true)
        over = np.concatenate(over)
        print(f"{len(over)} foci at the {place.name}: reported minus true {over.min():+.2f} to {over.max():+.2f} dB")


def _frame(drive: Drive, row: int) -> Drive:
    return replace(drive, phase=drive.phase[[row]], level=drive.level[[row]])


def safe(thing: str, levels: list[float], data: Path) -> None:
    """Print what the palm gets under each level, and the level at the ears by the direct sum, also of true arrays.

    am-i is the first pattern of experiment 5.2. True arrays have random transducers of each spread, with a mean
    strength of 1 as in the check.
    """
    plan, settings = FidelityPlan(), quiet_mode().but(strength=0.15)
    if thing == "denim":
        with TemporaryDirectory() as folder:
            take = open_take(data / "fabricslide" / "fabric" / "Denim_F180_V-50mmps_0.csv").recording
            original = original_of(str(kept(fast(take), Path(folder) / "denim.h5")), plan, settings)
    elif thing == "am-i":
        with plan.rig.touched_by(thing) as sensor:
            took = calibrated_pressure(record(sensor, 0.4).recording, sensor.calibration, settings)
        original = took.cut(0.2, plan.duration)
    else:
        original = original_of(thing, plan, settings)
    rig = replace(plan.rig, cells=original.sensor)
    equal = best_mode().but(strength=0.15)
    asked = add_lead(original, required_lead(equal))
    loud = measure_exposure(reproduce(asked, rig.array, equal).solution.drive, rig.array, PROFILE)
    print(
        f"{thing}: best mode {loud.pressure:.1f} Pa, ears {loud.peak[:2].max():.1f} dB, bystander {loud.peak[2]:.1f} dB"
    )
    plan = BudgetPlan(settings=settings, rig=rig)
    asked = add_lead(original, lead := required_lead(settings))
    for limit in levels:
        made = reproduce(asked, rig.array, settings.but(ears=limit))
        drive = made.solution.drive
        fitted = Settings.of(drive.provenance) or settings
        outputs = list(stage_outputs(asked, made, replace(plan, settings=fitted), no_progress))
        part = (lead, original.frames / original.rate)
        found = budget(asked, outputs, strength=made.strength(), band=fitted.calibration.band, judged=part)
        palm = next(each.pressure for each in outputs if each.name == "silencer").cut(*part)
        people, check = felt(palm.pressure, palm.rate, palm.sensor.pitch), measure_exposure(drive, rig.array, PROFILE)
        left = loud.pressure * 10 ** (-max(loud.peak[:2].max() - limit, 0) / 10)
        weaker = people.at(20 * np.log10(left / check.pressure))
        print(f"  best mode attenuated to {limit:g} dB: {left:.2g} Pa, felt {weaker}")
        true = {str(spread or "equal"): true_ears(drive, spread) for spread in (None, *SPREADS)}
        cells, unlike = found.stage("silencer").so_far.distortion_ratio, level_if_unlike(drive, PROFILE)[:2].max()
        print(
            f"  {limit:g} dB: strength {made.strength():.3f}, palm {check.pressure:.2g} Pa, felt {people}, "
            f"touched cells {cells:.1f} dB; check: ears {check.peak[:2].max():.1f}, bystander {check.peak[2]:.1f}, "
            f"unlike {unlike:.1f} dB; direct sum at the ears: "
            + ", ".join(f"{name} {level:.1f}" for name, level in true.items()),
            flush=True,
        )


def true_ears(drive: Drive, spread: TransducerSpread | None, *, loudest: int = 24, seed: int = 0) -> float:
    """Level in dB at the louder ear: direct sum over loud frames in dry air of 14, 22, 30 °C; true arrays at 14 °C."""
    chosen = np.argsort(measure_exposure(drive, ARRAY, PROFILE, alone=True).level[:, :2].max(axis=1))[-loudest:]
    q, degrees = sounding(drive)[chosen], (14, 22, 30)
    if spread is not None:
        transducers = VirtualRig(seed=seed, spread=spread).array_device().chain.transducers
        known = np.ones(1) if transducers is None else transducers.response
        q, degrees = q * known / np.abs(known).mean(), (14,)
    found, edge = [], np.linspace(-1, 1, 17)
    for place, each in product(PROFILE.places[:2], degrees):
        air, cube = Medium.at(temperature=each, humidity=0.1), np.stack(np.meshgrid(edge, edge, edge), axis=-1)
        points = place.reach * cube.reshape(-1, 3) + place.position
        field = direct_sum(q, points, air)
        frame = q[[field.max(axis=0).argmax()]]
        best = points[np.argsort(field.max(axis=1))[-5:]]
        found.append(max(field.max(), direct_sum(frame, within(place, best, 2.5e-3, 7), air).max()))
    return float(sound_level(np.array(max(found))))


if __name__ == "__main__":
    main()
