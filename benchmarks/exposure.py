"""Errors of the exposure check in both directions, and its time: `python -m benchmarks.exposure`.

The parts are: random foci in the cubes around the head, a third of them on a surface; an adversary that optimises
phases to be loud at one point in a random air and quiet at all points and airs of the check; another that solves for
such phases and levels directly; drives of strokes compared with the field on a grid of a tenth of a wavelength; and the
time for a drive of 5 s compared with the former check of 27 points.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.clock import load
from midair.datasets import stroke
from midair.devices import measure_exposure
from midair.devices.frame_bytes import PHASE_STEPS, amplitude_of
from midair.files import profile_named
from midair.model import Acoustics, AmplitudeFrames, ControlGrid, Drive, Medium, TransducerArray
from midair.physics import (
    Place,
    airs_of_room,
    focus_amplitude,
    focus_phase,
    searched_points,
    sound_level,
    transfer_matrix,
)
from midair.solvers import solve
from midair.targets import prepare

ARRAY = TransducerArray.autd3()
PROFILE = profile_named("occupational-110")
PARTS = ("foci", "adversary", "solved", "natural", "time")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exposure", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=PARTS, nargs="*", default=list(PARTS), help="only these parts (default all)")
    parser.add_argument("--foci", type=int, default=10_000, help="random foci (default 10000)")
    parser.add_argument("--attacks", type=int, default=96, help="number of attacks at each ear (default 96)")
    parser.add_argument("--steps", type=int, default=200, help="optimisation steps per attack (default 200)")
    parser.add_argument("--solved", type=int, default=40, help="number of solved attacks at each place (default 40)")
    parser.add_argument("--room", type=float, help="air temperature in degrees Celsius (default: unknown)")
    parser.add_argument("--surface", action="store_true", help="attack points on the cube's surface only")
    parser.add_argument("--levels", action="store_true", help="attacks also optimise the level of each transducer")
    parser.add_argument("--frames", type=int, default=5000, help="frames of the timed drive (default 5000)")
    parser.add_argument(
        "--apart", type=float, default=0.1, help="spacing of the finest grid in wavelengths (default .1)"
    )
    options = parser.parse_args()
    print(load())
    rng = np.random.default_rng(2026)
    room = None if options.room is None else Medium.at(temperature=options.room)
    if "foci" in options.part:
        foci(options.foci, rng, room)
    if "adversary" in options.part:
        for ear in range(2):
            adversary(ear, options.attacks, options.steps, rng, room, surface=options.surface, levels=options.levels)
    if "solved" in options.part:
        for number in range(3):
            solved(number, options.solved, rng, room, surface=options.surface)
    if "natural" in options.part:
        natural(options.apart)
    if "time" in options.part:
        timed(options.frames, rng)


def some_air(rng: np.random.Generator, room: Medium | None) -> Acoustics:
    """Random air: 15 to 30 degrees, or within 2 degrees of the stated temperature, at any likely humidity."""
    cold, warm = (15.0, 30.0) if room is None else (room.degrees - 2, room.degrees + 2)
    return Acoustics(medium=Medium.at(temperature=rng.uniform(cold, warm), humidity=rng.uniform(0.3, 0.7)))


def foci(count: int, rng: np.random.Generator, room: Medium | None) -> None:
    for number, place in enumerate(PROFILE.places[:3]):
        over = []
        for _ in range(0, count // 3, 512):
            points, air = somewhere(place, 512, rng), some_air(rng, room)
            drive = told(np.stack([focus_phase(ARRAY, point, acoustics=air) for point in points]))
            true = sound_level(np.abs((drive.q * transfer_matrix(points, ARRAY, acoustics=air)).sum(axis=1)))
            over.append(measure_exposure(drive, ARRAY, PROFILE, room=room).level[:, number] - true)
        over = np.concatenate(over)
        print(f"{len(over)} foci at the {place.name}: reported minus true {over.min():+.2f} to {over.max():+.2f} dB")


def adversary(
    number: int,
    attacks: int,
    steps: int,
    rng: np.random.Generator,
    room: Medium | None,
    *,
    surface: bool,
    levels: bool = False,
    batch: int = 24,
) -> None:
    place = PROFILE.places[number]
    looked_at = all_looked_at(place, room)
    missed = []
    for first in range(0, attacks, batch):
        points = somewhere(place, batch, rng, surface=surface)
        wanted = np.stack([transfer_matrix(point[None], ARRAY, acoustics=some_air(rng, room))[0] for point in points])
        wanted = wanted.astype(np.complex64)
        # Half of the attacks begin with a focus on the point, half with random phases.
        start = -np.angle(wanted) if first // batch % 2 == 0 else rng.uniform(0, 2 * np.pi, wanted.shape)
        drive = attack(start, wanted, looked_at, steps, levels=levels)
        true = sound_level(np.abs((drive.q * wanted).sum(axis=1)))
        missed.append(true - measure_exposure(drive, ARRAY, PROFILE, room=room).level[:, number])
    missed = np.concatenate(missed)
    print(
        f"adversary, {len(missed)} attacks at the {place.name}: true minus reported, worst {missed.max():+.2f} dB",
        end="",
    )
    print(f", mean {missed.mean():+.2f} dB", flush=True)


def all_looked_at(place: Place, room: Medium | None) -> NDArray[np.complex64]:
    """Transfer matrix to every point and air of the check, shape (air x point, transducer)."""
    airs = airs_of_room(room, PROFILE.places, ARRAY)
    points = searched_points(place, ARRAY, airs, among=PROFILE.places)
    return np.concatenate([transfer_matrix(points, ARRAY, acoustics=air).astype(np.complex64) for air in airs])


def solved(
    number: int,
    attacks: int,
    rng: np.random.Generator,
    room: Medium | None,
    *,
    surface: bool,
    modes: int = 240,
    rounds: int = 12,
) -> None:
    """Solve for drives with free levels that are loud at one point and as quiet as possible where the check looks.

    Least squares with weights that follow the loudest points (Lawson), in the strongest modes of all checked points.
    Each point is solved for several penalties on the strength of the drive; the worst one counts.
    """
    place = PROFILE.places[number]
    seen = all_looked_at(place, room)
    power, vectors = np.linalg.eigh((seen.conj().T @ seen / len(seen)).astype(np.complex128))
    basis = vectors[:, -modes:]
    seen, missed = seen @ basis.astype(np.complex64), []
    for point in somewhere(place, attacks, rng, surface=surface):
        wanted = transfer_matrix(point[None], ARRAY, acoustics=some_air(rng, room))[0]
        found, there = [], (wanted @ basis).conj()
        for effort in power[-1] * 10.0 ** np.arange(-7, -1):
            weight, made = np.full(len(seen), 1 / len(seen), np.float32), there
            for _ in range(rounds):
                weighed = np.sqrt(weight)[:, None] * seen
                normal = (weighed.conj().T @ weighed).astype(np.complex128)
                normal[np.diag_indices(modes)] += effort
                made = np.linalg.solve(normal, there)
                made /= there.conj() @ made
                loud = np.abs(seen @ made.astype(np.complex64))
                weight *= loud / loud.max() + 1e-4
                weight /= weight.sum()
            found.append(basis @ made)
        q = np.stack(found)
        q /= np.abs(q).max(axis=1, keepdims=True)
        drive = told(np.angle(q), np.abs(q))
        true = sound_level(np.abs(drive.q @ wanted))
        missed.append((true - measure_exposure(drive, ARRAY, PROFILE, room=room).level[:, number]).max())
    print(
        f"solved for, {attacks} attacks at the {place.name}: true minus reported, worst {max(missed):+.2f} dB, "
        f"mean {np.mean(missed):+.2f} dB",
        flush=True,
    )


def attack(
    phase: NDArray[np.float64],
    wanted: NDArray[np.complex64],
    looked_at: NDArray[np.complex64],
    steps: int,
    *,
    levels: bool,
) -> Drive:
    """Optimise drives with Adam to be loud at the wanted points, one per frame, and quiet at the checked points."""
    # Levels are squares of sines, which keeps them between 0 and 1; they start near 1.
    turned = np.concatenate([phase, np.full(phase.shape, 1.3)], axis=1)
    pace, size, back = np.zeros_like(turned), np.zeros_like(turned), np.ascontiguousarray(looked_at.T)
    for step in range(steps):
        phase, angle = np.split(turned, 2, axis=1)
        level = np.sin(angle) ** 2 if levels else np.ones_like(angle)
        wave = np.exp(1j * phase).astype(np.complex64)
        q = (level * wave).astype(np.complex64)
        seen, there = q @ back, (q * wanted).sum(axis=1, keepdims=True)
        power = np.abs(seen) ** 2
        weight = (power / power.max(axis=1, keepdims=True)) ** (4 + 28 * min(1.0, step / (0.7 * steps)))
        # Set negligible weights to 0, because denormal numbers in single precision are slow.
        weight[weight < 1e-9] = 0
        weight /= weight.sum(axis=1, keepdims=True)
        uphill = wanted / there - (weight / power * seen.conj()) @ looked_at
        slope = np.concatenate([-(uphill * q).imag, (uphill * wave).real * np.sin(2 * angle) * levels], axis=1)
        pace, size = 0.9 * pace + 0.1 * slope, 0.99 * size + 0.01 * slope**2
        rate = 0.15 * (1 - 0.9 * step / steps)
        turned = turned + rate * pace / (1 - 0.9 ** (step + 1)) / (np.sqrt(size / (1 - 0.99 ** (step + 1))) + 1e-8)
    phase, angle = np.split(turned, 2, axis=1)
    return told(phase, np.sin(angle) ** 2 if levels else None)


def natural(apart: float, *, frames: int = 300, loudest: int = 6) -> None:
    """Drives of strokes: the reported peak, and the peak of the loudest frames on the finest grid."""
    drives = {}
    for name in ("towel", "brush", "sponge"):
        for height, strength in product((0.15, 0.2, 0.25), (0.05, 0.15, 0.3)):
            grid = ControlGrid(height=height)
            amplitude = prepare(stroke(name), grid=grid).amplitude
            amplitude = amplitude[amplitude.max(axis=1) > 0.01 * amplitude.max()][:frames]
            amplitude = strength * focus_amplitude(grid, ARRAY) * amplitude / amplitude.max()
            target = AmplitudeFrames(amplitude=amplitude, rate=1000.0, grid=grid)
            label = f"{name:6} {1e3 * height:.0f} mm, strength {strength:.2f}"
            drives[label] = solve(target, ARRAY, method="fast", level="auto").drive
    for number, place in enumerate(PROFILE.places[:2]):
        reported = [measure_exposure(drive, ARRAY, PROFILE).level[:, number] for drive in drives.values()]
        strongest = [
            drive.q[np.argsort(level)[-loudest:]] for drive, level in zip(drives.values(), reported, strict=True)
        ]
        together = np.concatenate(strongest)
        true = np.max(
            [finest(together, place, apart, Medium.at(temperature=each)) for each in range(14, 31, 2)], axis=0
        )
        true = true.reshape(len(drives), -1).max(axis=1)
        for label, level, most in zip(drives, reported, true, strict=True):
            print(f"{place.name}, {label}: reported minus true {level.max() - most:+.2f} dB", flush=True)


def finest(q: NDArray[np.complex128], place: Place, apart: float, medium: Medium) -> NDArray[np.float64]:
    """Level of some frames in dB at the loudest point of a grid over the cube."""
    steps = np.linspace(-place.reach, place.reach, int(np.ceil(2 * place.reach / (8.5e-3 * apart))) + 1)
    told = q.T.astype(np.complex64)
    loudest = np.zeros(len(q))
    for x, y in product(steps, steps):
        points = np.stack([np.full(steps.size, x), np.full(steps.size, y), steps], axis=1) + place.position
        matrix = transfer_matrix(points, ARRAY, acoustics=Acoustics(medium=medium))
        there = np.abs(matrix.astype(np.complex64) @ told)
        loudest = np.maximum(loudest, there.max(axis=0))
    return sound_level(loudest)


def timed(frames: int, rng: np.random.Generator) -> None:
    """Time 27 points in double precision, the first drive on an array, and a later one, in one run."""
    drive = told(rng.uniform(0, 2 * np.pi, (frames, ARRAY.count)))
    for _ in range(3):
        # A slightly moved place forces new points and modes.
        profile = replace(PROFILE, places=tuple(_moved(place, rng) for place in PROFILE.places))
        with threadpool_limits(limits=1, user_api="blas"):
            before = seconds(lambda: corners(drive))
        first = seconds(lambda: measure_exposure(drive, ARRAY, profile))  # noqa: B023
        later = seconds(lambda: measure_exposure(drive, ARRAY, profile))  # noqa: B023
        print(f"{frames} frames: 27 points {before}, first drive {first}, later {later}")


def seconds(work: Callable[[], object]) -> str:
    """Wall and CPU time in s."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return f"{time.perf_counter() - wall:.2f} s ({time.process_time() - cpu:.2f} s of CPU)"


def _moved(place: Place, rng: np.random.Generator) -> Place:
    x, y, z = (each + 1e-6 * rng.random() for each in place.position)
    return replace(place, position=(x, y, z))


def corners(drive: Drive) -> NDArray[np.float64]:
    """The former check: the loudest of 27 points of each place, in double precision."""
    points = np.concatenate([place.points for place in PROFILE.places])
    matrix = transfer_matrix(points, drive.array, acoustics=drive.acoustics).T
    level = np.empty((drive.frames, len(PROFILE.places)))
    for first in range(0, drive.frames, 256):
        part = slice(first, first + 256)
        q = drive.level[part, None] * np.exp(1j * drive.phase[part])
        level[part] = sound_level(np.abs(q @ matrix).reshape(-1, len(PROFILE.places), 27).max(axis=2))
    return level


def somewhere(place: Place, count: int, rng: np.random.Generator, *, surface: bool = False) -> NDArray[np.float64]:
    """Random points in a place's cube: two of three inside, the third (or all) on its surface."""
    share = rng.uniform(-1, 1, (count, 3))
    for number in range(0, count, 1 if surface else 3):
        sides = rng.permutation(3)[: 1 + number // 3 % 3]
        share[number, sides] = rng.choice([-1, 1], len(sides))
    return np.array(place.position) + place.reach * share


def told(phase: NDArray[np.float64], level: NDArray[np.float64] | None = None) -> Drive:
    """A drive with the phase and level steps of the firmware, as the units play it and as the check rounds it."""
    turn = 2 * np.pi / PHASE_STEPS
    played = np.ones(len(phase)) if level is None else amplitude_of(np.rint(level * 255).astype(np.uint8))
    return Drive(phase=np.rint(phase / turn) * turn, level=played, rate=1000.0, array=ARRAY)


if __name__ == "__main__":
    main()
