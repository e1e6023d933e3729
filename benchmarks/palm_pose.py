"""Palms that are not where a drive was solved for: `python -m benchmarks.palm_pose`, recordings in ../shared/data.

`table`: signal to distortion in dB of the pressure on the 16 cells, with one gain, against the target, for a palm that
lies elsewhere: as it is, steered to its centre, steered to the place of the pressure, fitted to the palm as well, and
solved again for that palm.
`follow`: the same for recorded palms that move, as they are and followed over the latency of a tracker, with and
without prediction; the median over pieces of 1 s, without the first .3 s, of frames that sound, and the share of those.
`exposure`: an attack on the check of steered frames: random drives, each steered to random poses of the box. For each
place least / median / most over the drives in dB: the level of the admission, then that of the check of the loudest
frame, above an independent sum over a grid in the same cube; and the loudest pose above the median pose.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.clock import load
from benchmarks.exposure_attacks import direct_sum, sounding, waves, within
from benchmarks.real_objects import takes
from benchmarks.trackers import RECORDINGS, at_the_array
from midair.devices import ExposureChoices
from midair.files import DEFAULT_PROFILE, load_palm_path, profile_named, save_palm_path
from midair.model import Acoustics, ControlGrid, Drive, Medium, PalmPath, TransducerArray
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.physics import (
    PalmFit,
    Place,
    PoseBox,
    aims_of,
    airs_of_room,
    array_from_palm,
    cell_weights,
    exposure_excess,
    focus_phase,
    middle_of,
    on_the_palm,
    pose_of,
    poses_at,
    radiation_pressure,
    sound_level,
    steering_phase,
    transfer_matrix,
)
from midair.physics import (
    exposure as exposure_of,
)
from midair.pipeline import reproduce, required_lead
from midair.rig import PlaySettings, VirtualRig
from midair.rig.playing import FollowRules, clear_followed, follow_simulated, tracker_name
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
    aims, fit = aims_of(drive, grid), PalmFit(rig.array, ROOM, grid)
    found: dict[str, list[float]] = {
        "as it is": [],
        "centre": [],
        "aimed": [],
        "fitted": [],
        **({"again": []} if again else {}),
    }
    for name in names:
        at = pose(*POSES[name], solved)
        found["as it is"].append(felt(drive, at))
        found["centre"].append(felt(drive, at, steering_phase(rig.array, ROOM.medium, solved, at)))
        many = poses_at(at, np.arange(len(aims), dtype=float))
        steering = steering_phase(rig.array, ROOM.medium, solved, many, aim=aims)
        found["aimed"].append(felt(drive, at, steering))
        fit.move(at)
        beside = np.angle(fit(drive.phase, drive.phase + steering))
        found["fitted"].append(felt(drive, at, steering + beside))
        if again:
            other = reproduce(asked, array_from_palm(rig.array, solved, at), settings).solution.drive
            found["again"].append(felt(other, at))
    for name, each in found.items():
        print(f"| {Path(thing).stem}, {name} | {' | '.join(f'{one:.1f}' for one in each)} |", flush=True)


class Held:
    """The last pose, without prediction."""

    last: PalmPath

    def add(self, poses: PalmPath) -> None:
        self.last = pose_of(poses, -1)

    def at(self, times: NDArray[np.float64]) -> PalmPath:
        return poses_at(self.last, times)


def follow(
    thing: str, plan: FidelityPlan, data: Path, folder: Path, latencies: Sequence[float], *, fit: bool = True
) -> None:
    """Print the table of recorded palms; the signal is repeated for as long as a recording lasts."""
    print(f"\n{thing}, best mode, {plan.duration:g} s repeated")
    settings = MODES["best"]
    original = original_of(thing, plan, settings)
    settings = at_strength(original, settings, plan)
    lead = required_lead(settings)
    made = reproduce(add_lead(original, lead), plan.rig.array, settings)
    grid, rate = settings.target.grid, settings.target.rate
    cells = replace(plan.rig, cells=original.sensor).sensor_model
    points = ControlGrid(rows=18, columns=18, pitch=11e-3 / 3)
    weights = cell_weights(cells, points, between="waves")
    drawn = cell_weights(cells, grid, between="lines")
    piece = slice(round(lead * rate), -round(lead * rate))
    target = (radiation_pressure(made.target.amplitude, ROOM.medium) @ drawn.T)[piece]
    drive = made.solution.drive
    once = replace(drive, phase=drive.phase[piece], level=drive.level[piece])
    for name, file in RECORDINGS.items():
        palm = at_the_array(load_palm_path(data / "palm-poses" / file))
        palm = replace(palm, time=palm.time - palm.time[0])
        path, repeats = folder / f"{name}.csv", int(palm.time[-1] * rate / once.frames)
        save_palm_path(palm, path)
        ways = {"as it is": [once] * repeats}
        whole = {"repeats": repeats, "report": lambda _: None, "rules": FollowRules(patience=0.2, fit=fit)}
        for ms in latencies:
            tracker = tracker_name(f"replay:{path}", 1e-3 * ms)
            for way, predictor in (("held", Held()), ("predicted", None)):
                ways[f"{ms:g} ms, {way}"] = [follow_simulated(once, tracker, grid, predictor=predictor, **whole)]
        rng = np.random.default_rng(0)
        frames = np.sort(rng.choice(np.arange(int(0.3 * rate), repeats * once.frames), 100 * repeats, replace=False))
        poses = poses_at(palm, frames / rate)
        inside = PoseBox().inside(poses, middle_of(grid))
        felt = {way: np.zeros((len(frames), cells.grid.count)) for way in ways}
        sounds = {way: np.zeros(len(frames), bool) for way in ways}
        for at, there in enumerate(on_the_palm(points.position, middle_of(grid), poses)):
            matrix = transfer_matrix(there, drive.array, acoustics=ROOM)
            for way, drives in ways.items():
                number, rest = divmod(int(frames[at]), drives[0].frames)
                q = drives[number].level[rest] * np.exp(1j * drives[number].phase[rest])
                felt[way][at] = weights @ np.abs(matrix @ q) ** 2
                sounds[way][at] = drives[number].level[rest] > 0.99 * once.level[rest % once.frames]
        wanted = target[frames % once.frames]
        for way in ways:
            heard, found = sounds[way] & inside, []
            for second in range(int(frames[-1] / rate) + 1):
                part = heard & (frames // rate == second)
                found += [ratio(wanted[part], felt[way][part])] if part.sum() > 30 else []
            print(f"| {name} | {way} | {np.median(found):.1f} | {100 * heard.mean():.0f} % |", flush=True)


def random_drive(array: TransducerArray, solved: NDArray[np.float64], rng: np.random.Generator, kind: int) -> Drive:
    """Eight frames at full level: one, two or three foci on the palm with random phases, or random phases."""
    aims = solved + rng.uniform(-0.03, 0.03, (8, 1 + kind % 4, 3)) * [1, 1, 0]
    foci = [[np.exp(1j * (focus_phase(array, aim) + rng.uniform(0, 6))) for aim in frame] for frame in aims]
    phase = rng.uniform(0, 2 * np.pi, (8, array.count)) if kind % 4 == 3 else np.angle(np.sum(foci, axis=1))
    return Drive(phase=phase, level=np.ones(8), rate=1000.0, array=array)


def random_poses(solved: NDArray[np.float64], count: int, rng: np.random.Generator) -> PalmPath:
    """Poses of the whole box, every fourth one on an edge of it, tilted by up to its limit in any direction."""
    share = rng.uniform(-1, 1, (count, 3))
    share[::4] = np.sign(share[::4])
    tilt, way, turn = PoseBox().tilt * np.sqrt(rng.uniform(0, 1, count)), *rng.uniform(0, 2 * np.pi, (2, count))
    z = np.stack([np.sin(tilt) * np.cos(way), np.sin(tilt) * np.sin(way), np.cos(tilt)], axis=1)
    y = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    y = y - (y * z).sum(axis=1, keepdims=True) * z
    return PalmPath(
        time=np.arange(count, dtype=float),
        centre=solved + share / 2 * PoseBox().size,
        normal=-z,
        fingers=y / np.linalg.norm(y, axis=1, keepdims=True),
        confidence=np.ones(count),
    )


class Gated:
    """What the check asks of a device that sounds."""

    name, array, gated, steps_a_turn = "attacked", TransducerArray.autd3(), True, 256


def exposure(drives: int, poses: int, first: int = 0, *, fitted: bool = False) -> None:
    """Print how far the stated levels of steered frames lie above a direct sum: of the admission, and of each frame."""
    profile, room = profile_named(DEFAULT_PROFILE), Medium.at(temperature=22.0, humidity=0.4)
    array, grid = Gated.array, ControlGrid(rows=9, columns=9, pitch=8e-3)
    places, solved, airs = profile.places[:3], middle_of(grid), airs_of_room(room, profile.places, array)
    asked = PlaySettings(exposure=ExposureChoices(profile=profile, override="attack", room=room))
    sums = {
        (each.name, number): waves(coarse_points(each), air.medium)
        for each in places
        for number, air in enumerate(airs)
    }
    found, spent, fit = np.empty((drives, 4, len(places))), np.zeros(2), PalmFit(array, ROOM, grid)
    for number in range(drives):
        rng = np.random.default_rng(first + number)
        drive, palms = random_drive(array, solved, rng, first + number), random_poses(solved, poses, rng)
        stated = clear_followed(drive, Gated, asked, grid).exposure.level.max(axis=0)[:3]  # type: ignore[arg-type]
        frames = rng.integers(0, drive.frames, poses)
        extra = steering_phase(array, ROOM.medium, solved, palms, aim=aims_of(drive, grid)[frames])
        phase = drive.phase[frames] + extra
        if fitted:
            for at in range(poses):
                fit.move(pose_of(palms, at))
                phase[at] += np.angle(fit(drive.phase[frames[[at]]], phase[[at]])[0])
        steered = replace(drive, phase=phase, level=np.ones(poses))
        began = time.process_time()
        exposure_excess(steered, profile, airs, steps=256)
        spent[0] += time.process_time() - began
        each = exposure_of(steered, profile, acoustics=airs, steps=256).level[:, :3]
        q = sounding(steered)
        for column, place in enumerate(places):
            true, at = loudest_pose(place, q, [sums[place.name, air] for air in range(len(airs))], airs)
            found[number, :, column] = stated[column], each[at, column], true, np.median(each[:, column])
        spent[1] += time.process_time() - began
    admitted, checked, true, middle = np.moveaxis(found, 1, 0)
    print(
        f"drives {first} to {first + drives - 1}, {poses} poses each, {len(airs)} airs; "
        f"{1e6 * spent[0] / (drives * poses):.0f} us of CPU a frame of the check, {spent.sum():.0f} s in all"
    )
    for column, place in enumerate(places):
        parts = (admitted - true, checked - true, true - middle)
        texts = (
            f"{each[:, column].min():.2f} / {np.median(each[:, column]):.2f} / {each[:, column].max():.2f}"
            for each in parts
        )
        print(f"| {place.name} | {' | '.join(texts)} |", flush=True)


def loudest_pose(
    place: Place, q: NDArray[np.complex128], sums: Sequence[NDArray[np.complex64]], airs: Sequence[Acoustics]
) -> tuple[float, int]:
    """Level in dB and number of the loudest frame: a grid of 8 mm for all, then 1.3 mm around the three best."""
    single, coarse, best = q.astype(np.complex64).T, coarse_points(place), [(0.0, 0)]
    for matrix, air in zip(sums, airs, strict=True):
        field = matrix @ single
        power = field.real**2 + field.imag**2
        loudest = power.max(axis=0)
        for frame in np.argsort(loudest)[-3:]:
            points = within(place, coarse[np.argsort(power[:, frame])[-2:]], 4e-3, 7)
            best.append((float(direct_sum(q[[frame]], points, air.medium).max()), int(frame)))
    level, frame = max(best)
    return float(sound_level(np.array(level))), frame


def coarse_points(place: Place) -> NDArray[np.float64]:
    """Points 8 mm apart in the cube of a place."""
    edge = np.linspace(-place.reach, place.reach, 11)
    return np.stack(np.meshgrid(edge, edge, edge), axis=-1).reshape(-1, 3) + place.position


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.palm_pose", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=HERE, help="folder with the recordings")
    parser.add_argument(
        "--part", choices=("table", "follow", "exposure"), nargs="+", default=["table"], help="(default table)"
    )
    parser.add_argument("--latencies", type=float, nargs="+", default=[10, 20, 40], help="in ms (default 10 20 40)")
    parser.add_argument("--drives", type=int, default=200, help="random drives for exposure (default 200)")
    parser.add_argument("--first", type=int, default=0, help="number of the first of these drives (default 0)")
    parser.add_argument("--random-poses", type=int, default=1000, help="poses of each for exposure (default 1000)")
    parser.add_argument("--fitted", action="store_true", help="the frames for exposure are fitted, too")
    parser.add_argument("--steer-only", action="store_true", help="follow without the fit")
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
        if "table" in options.part:
            table(things, options.poses, plan, again=options.again)
        if "exposure" in options.part:
            exposure(options.drives, options.random_poses, options.first, fitted=options.fitted)
        if "follow" in options.part:
            follow(things[0], plan, options.data, Path(folder), options.latencies, fit=not options.steer_only)


if __name__ == "__main__":
    main()
