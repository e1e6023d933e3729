"""The exposure check against the sum of all waves over time: `python -m benchmarks.exposure_time`.

Hostile drives of a few frames that repeat are solved to be loud at one point and moment, and as quiet as possible at
all moments, points and airs of the check; others turn all phases alike. Ordinary ones are solved from strokes. The true
level is that of the sum of all waves, each of which changes when its next frame arrives, without code of the check: as
the rms over any 0.25 ms with ideal transducers, and as the highest moment with transducers as slow as midair's.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.clock import load
from benchmarks.exposure import some_air
from benchmarks.exposure_attacks import ARRAY, POSITIONS, Array, played, somewhere, sounding, waves, within
from midair.devices import measure_exposure
from midair.files import profile_named
from midair.model import Drive, Medium
from midair.physics import Place, airs_of_room, searches_of, sound_level
from midair.physics.exposure_time import octants_of

PROFILE = profile_named("occupational-110")
STEP = 25e-6
"""Time between two moments of the true field, in s."""
WINDOW = 10
"""Moments over which the field of ideal transducers is averaged."""
SLOW = 188e-6
"""Time constant of a transducer in s, the smallest that midair assumes."""


def over_time(drive: Drive, points: Array, medium: Medium) -> tuple[Array, Array]:
    """Highest level in dB at each point, for ideal and for slow transducers, both (point,)."""
    q = np.concatenate([np.zeros((1, ARRAY.count)), sounding(drive), np.zeros((1, ARRAY.count))])
    change, begin = np.diff(q, axis=0), np.arange(drive.frames + 1) / drive.rate
    path = np.linalg.norm(points[:, None] - POSITIONS, axis=2)
    late = (path - path.min(axis=1, keepdims=True)) / medium.speed
    count = int((begin[-1] + late.max()) / STEP) + 2 * WINDOW
    ideal, slow = np.empty(len(points)), np.empty(len(points))
    for number, (wave, delay) in enumerate(zip(waves(points, medium), late, strict=True)):
        jumps, when = (wave * change).ravel(), ((begin[:, None] + delay) / STEP).astype(int).ravel() + 1
        heard = np.bincount(when, jumps.real, count) + 1j * np.bincount(when, jumps.imag, count)
        field = np.cumsum(heard)
        power = np.convolve(np.abs(field) ** 2, np.ones(WINDOW) / WINDOW, mode="valid")
        ideal[number] = np.sqrt(power.max())
        kept = np.exp(-STEP / SLOW)
        slow[number] = np.abs(lfilter([1 - kept], [1, -kept], field)).max()
    return sound_level(ideal), sound_level(slow)


def truth(drive: Drive, place: Place, medium: Medium, aim: Array | None = None) -> tuple[float, float]:
    """Highest level in a cube for ideal and for slow transducers: a grid, or an aim, then points around the best."""
    edge = np.linspace(-place.reach, place.reach, 7)
    grid = np.stack(np.meshgrid(edge, edge, edge, indexing="ij"), axis=-1).reshape(-1, 3) + place.position
    points = grid if aim is None else within(place, aim[None], 12e-3, 5)
    most = (-np.inf, -np.inf)
    for reach in (7e-3, 2e-3):
        found = over_time(drive, points, medium)
        most = (max(most[0], found[0].max()), max(most[1], found[1].max()))
        best = np.unique(np.concatenate([np.argsort(each)[-2:] for each in found]))
        points = within(place, points[best], reach, 4)
    found = over_time(drive, points, medium)
    return max(most[0], found[0].max()), max(most[1], found[1].max())


def periodic(frames: NDArray[np.complex128], rate: float) -> Drive:
    """Frames that repeat for some 12 ms, and begin and end softly, at the steps of the firmware."""
    count = len(frames) * max(4, round(0.012 * rate / len(frames)))
    q = np.resize(frames / np.abs(frames).max(), (count, ARRAY.count))
    edge = max(2, round(0.002 * rate))
    ramp = np.minimum(1, np.minimum(np.arange(1, count + 1), np.arange(count, 0, -1)) / edge)
    return replace(played(np.angle(q), np.abs(q) * ramp[:, None]), rate=rate)


def hidden(rng: np.random.Generator, place: Place, aim: Array, medium: Medium, rate: float, count: int) -> list[Drive]:
    """Frames that are loud at one point and moment, and quiet in all octants of the check at all of its moments.

    Frames repeat, so that their spectrum has `count` lines, each of which is solved alone.
    """
    airs = airs_of_room(None, PROFILE.places, ARRAY)
    search = searches_of(PROFILE.places, ARRAY, airs).each[PROFILE.places.index(place)]
    wave, late = waves(aim[None], medium)[0], np.linalg.norm(aim - POSITIONS, axis=1)
    own = np.ceil((late - late.min()) / medium.speed * rate - rng.uniform(0, 1)).clip(0)
    known = []
    for groups, moments in ((each.arrivals.groups, each.arrivals.count) for each in octants_of(search, rate)):
        modes, group = np.empty((len(groups[0][1]) // 2, ARRAY.count), np.complex64), np.empty(ARRAY.count)
        for number, (members, matrix) in enumerate(groups):
            real, imaginary = matrix[:, : len(members)].reshape(2, len(modes), -1)
            modes[:, members], group[members] = real + 1j * imaginary, number
        known += [(modes, np.ceil((group - moment) / moments).clip(0)) for moment in range(moments)]
    normals, wanted = [], []
    for line in -2j * np.pi * np.arange(count) / count:
        matrix = np.concatenate([modes * np.exp(line * age).astype(np.complex64) for modes, age in known])
        normals.append(matrix.conj().T @ matrix)
        wanted.append((wave * np.exp(line * own)).conj())
    found, frame = [], np.arange(count)
    for effort in (1e-5, 1e-3):
        load = effort * max(np.abs(np.diag(each)).max() for each in normals) * np.eye(ARRAY.count, dtype=np.complex64)
        lines = np.stack([np.linalg.solve(one + load, each) for one, each in zip(normals, wanted, strict=True)])
        found.append(np.exp(2j * np.pi * np.outer(frame, frame) / count) @ lines)
    whole = [periodic(each.astype(np.complex128), rate) for each in found]
    return [*whole, periodic(np.exp(1j * np.angle(found[0])).astype(np.complex128), rate)]


def turning(rng: np.random.Generator, aim: Array, medium: Medium, rate: float) -> list[Drive]:
    """Phases that turn alike for all transducers, a frame of which is quiet where the check looks (as `hidden`)."""
    turn = rng.uniform(0.05, 0.45) * min(rate, 4000) * rng.choice([-1, 1])
    modes = np.concatenate(
        [searches_of(PROFILE.places, ARRAY, airs_of_room(None, PROFILE.places, ARRAY)).each[n].modes for n in range(2)]
    )
    late = np.linalg.norm(aim - POSITIONS, axis=1) / medium.speed
    # The wave of the turned carrier: the phase of each transducer advances by its time of arrival.
    wave = waves(aim[None], medium)[0] * np.exp(-2j * np.pi * turn * late)
    normal = modes.conj().T @ modes
    found = []
    for effort in (1e-5, 1e-3):
        loaded = normal + effort * np.abs(np.diag(normal)).max() * np.eye(len(normal), dtype=np.complex64)
        q = np.linalg.solve(loaded, wave.conj())
        frames = q * np.exp(2j * np.pi * turn * np.arange(round(0.02 * rate)) / rate)[:, None]
        found.append(periodic(frames, rate))
    return found


def hostile(first: int, count: int, seed: int) -> None:
    """Attack random points in random airs at 1, 4 and 8 kHz, and print the check's error for the best of each."""
    errors = []
    for number in range(first, first + count):
        rng, rate = np.random.default_rng([seed, number]), (1000.0, 4000.0, 8000.0)[number % 3]
        place = PROFILE.places[number // 3 % 2]
        aim, medium = somewhere(place, 1, rng, surface=number % 2 == 0)[0], some_air(rng, None)
        turned = number % 4 == 3
        drives = (
            turning(rng, aim, medium, rate) if turned else hidden(rng, place, aim, medium, rate, 2 + number // 6 % 2)
        )
        errors.append(min((compared(each, place, medium, aim) for each in drives), key=min))
        kind = "turning" if turned else "alternating"
        print(f"{number:3} {kind:11} {rate:5.0f} Hz {place.name:9} {said(errors[-1])}", flush=True)
    summary("hostile", errors)


def compared(drive: Drive, place: Place, medium: Medium, aim: Array | None = None) -> tuple[float, float]:
    """Level of the check minus the true one in dB, for ideal and for slow transducers."""
    level = measure_exposure(drive, ARRAY, PROFILE).peak[PROFILE.places.index(place)]
    ideal, slow = truth(drive, place, medium, aim)
    return float(level - ideal), float(level - slow)


def ordinary(files: list[str], count: int, rng: np.random.Generator) -> None:
    """Compare parts of 20 ms, with fades of 5 ms as in playing, in random airs; time the check for 5,000 frames."""
    import midair

    errors = []
    drives = [midair.load(each).drive for each in files]
    for number in range(count):
        drive, place, medium = (
            drives[number % len(drives)],
            PROFILE.places[number // len(drives) % 2],
            some_air(rng, None),
        )
        loud = np.flatnonzero(np.asarray(drive.level).reshape(drive.frames, -1).max(axis=1) > 0.3 * np.max(drive.level))
        frames, edge = round(0.03 * drive.rate), round(0.005 * drive.rate)
        first = int(rng.integers(loud[0], max(loud[0] + 1, loud[-1] - frames)))
        own, at = slice(first, first + frames), np.arange(frames)
        level = np.asarray(drive.level[own]).T * np.minimum(1, np.minimum(at + 1, frames - at) / edge)
        part = replace(played(np.asarray(drive.phase[own]), level.T), rate=drive.rate)
        errors.append(compared(part, place, medium))
        name = files[number % len(files)]
        alone, now = (measure_exposure(part, ARRAY, PROFILE, alone=each).peak for each in (True, False))
        more = (now - alone)[PROFILE.places.index(place)]
        print(f"{number:3} {name} {place.name:9} {said(errors[-1])}; {more:.2f} above frames alone", flush=True)
    summary("ordinary", errors)
    for name, drive in zip(files, drives, strict=True):
        rows = np.arange(5000) % drive.frames
        long = replace(drive, phase=np.asarray(drive.phase)[rows], level=np.asarray(drive.level)[rows], array=ARRAY)
        spent = []
        for alone in (True, False) * 2:
            begin = time.process_time()
            measure_exposure(long, ARRAY, PROFILE, alone=alone)
            spent.append(time.process_time() - begin)
        before, now = min(spent[::2]), min(spent[1::2])
        print(f"{name}: 5,000 frames alone {before:.2f} s of CPU, in time {now:.2f} s, {now / before:.2f} times")


def said(error: tuple[float, float]) -> str:
    """The error as text."""
    return f"said - true {error[0]:+.2f} ideal, {error[1]:+.2f} slow"


def summary(name: str, errors: list[tuple[float, float]]) -> None:
    """Print least, mean and largest error."""
    kinds = ("ideal transducers, rms over 0.25 ms", "slow transducers, highest moment")
    for kind, each in zip(kinds, zip(*errors, strict=True), strict=bool(errors)):
        print(f"{len(each)} {name} drives, {kind}: said - true least {min(each):+.2f},", end=" ")
        print(f"mean {np.mean(each):+.2f}, largest {max(each):+.2f} dB")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.exposure_time", description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="solved drives of 996 transducers, for the ordinary ones")
    parser.add_argument("--hostile", type=int, default=60, help="number of hostile drives (default 60)")
    parser.add_argument("--first", type=int, default=0, help="number of the first hostile drive (default 0)")
    parser.add_argument("--ordinary", type=int, default=30, help="number of ordinary drives (default 30)")
    parser.add_argument("--seed", type=int, default=2026, help="seed of all random numbers (default 2026)")
    options = parser.parse_args()
    print(load())
    if options.hostile:
        hostile(options.first, options.hostile, options.seed)
    if options.files:
        ordinary(options.files, options.ordinary, np.random.default_rng(options.seed))


if __name__ == "__main__":
    main()
