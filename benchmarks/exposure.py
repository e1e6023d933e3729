"""Errors of the exposure check in both directions: `python -m benchmarks.exposure`.

The parts are: attacks by an optimiser that uses all points and airs of the check, on random places in random airs;
and random foci, a third of them on a surface.
The true level is the sum of all waves at the units' own phase and level steps, maximised over place and air without
code of the check (`benchmarks.exposure_attacks`). Frames are measured alone; `benchmarks.exposure_time` has moments.
"""

from __future__ import annotations

import argparse

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
from midair.devices import measure_exposure
from midair.files import profile_named
from midair.model import Acoustics, Drive, Medium
from midair.physics import (
    Place,
    airs_of_room,
    focus_phase,
    searches_of,
    sound_level,
    transfer_matrix,
)

PROFILE = profile_named("occupational-110")
PARTS = ("attacks", "foci")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exposure", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these parts (default all)")
    parser.add_argument("--foci", type=int, default=3072, help="random foci (default 3072)")
    parser.add_argument("--attacks", type=int, default=102, help="number of attacks, in groups of 6 (default 102)")
    parser.add_argument("--steps", type=int, default=200, help="optimisation steps per attack (default 200)")
    parser.add_argument("--room", type=float, help="air temperature in degrees Celsius (default: unknown)")
    parser.add_argument("--surface", action="store_true", help="attack points on the cube's surface only")
    parser.add_argument("--seed", type=int, default=2026, help="seed of all random numbers (default 2026)")
    options = parser.parse_args()
    print(load())
    rng = np.random.default_rng(options.seed)
    room = None if options.room is None else Medium.at(temperature=options.room)
    if "attacks" in options.part:
        attacks(options.attacks, options.steps, rng, room, surface=options.surface)
    if "foci" in options.part:
        foci(options.foci, rng, room)


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
            drive, each = played(phase), [played(phase[[row]]) for row in range(512)]
            true = [loudest_near(place, *one, air, room) for one in zip(points, each, strict=True)]
            over.append(
                measure_exposure(drive, ARRAY, PROFILE, room=room, alone=True).level[:, number] - np.concatenate(true)
            )
        over = np.concatenate(over)
        print(f"{len(over)} foci at the {place.name}: reported minus true {over.min():+.2f} to {over.max():+.2f} dB")


if __name__ == "__main__":
    main()
