"""Solvers of whole recordings: `python -m benchmarks.recordings`, on sequences that were not used for tuning.

Three random sequences with fixed seeds, and the package's denim sample, with midair's own mapping from pressure to
targets. Paper's mode: 1 kHz, strength .1; the plain form of the paper's method solves only the first frames. Best mode:
4 kHz, strength .15, guard. One run, one BLAS thread. `was` is the former best mode: `fast`, 320 iterations, --smooth
0.2, a ceiling of .6.
`kinds`: eight recordings in the place of A to H of an earlier check (strokes A, B; sixteen taxels C; a waveform under
a disc D, E, and on 3 x 3 cells H; test signals F, and G with sixteen independent channels) in a mode: as
modelled, on unknown and on measured arrays. Files are from ../shared/data.
`receptors`: the mapping of that name on a towel, a sponge and a synthetic press, beside slow-bias and one focus.
Times are CPU times of this process including set-up, except for those labelled wall.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from threadpoolctl import threadpool_info

from benchmarks.clock import fastest, frame_times, heading, line, load, timed
from benchmarks.measured_array import kept
from benchmarks.real_pressure import pressure as real_pressure
from benchmarks.sequence import warm
from benchmarks.targets import ARRAY, moving_blob, problem_of, towel
from benchmarks.yardstick import plain
from midair.datasets import sample, stroke
from midair.devices import measure_exposure
from midair.dsp import resample
from midair.evaluate import TOUCHED, StageOutput, budget
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Acoustics, Calibration, Drive, PressureFrames, Provenance, SensorGrid
from midair.paper.modes_compared import FidelityPlan, at_strength, original_of
from midair.patterns import Foci, draw
from midair.physics import Transducers, cell_weights, focus_amplitude, simulate, transfer_matrix
from midair.pipeline import (
    Reproduction,
    calibrated_pressure,
    reproduce,
    required_lead,
    resample_pressure,
    target_amplitude,
)
from midair.rig import BudgetPlan, VirtualRig, error_budget
from midair.settings import MODES, Mode, Settings, best_mode, paper_mode
from midair.solvers import Fast, Glide, Guard, Live, Problem, Windows, error_of, one_blas_thread, spreading_phase
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.mirror_symmetry import Lattice
from midair.solvers.problem import GuardField
from midair.targets import MAPPINGS, Circle, add_lead, receptor_levels, receptor_pressure

RATE = 8000.0
PARTS = ("paper", "best", "skin", "jobs", "live", "kinds", "receptors")
KINDS = {
    "A": "towel",
    "B": "sponge",
    "C": "linen",
    "D": "stick on metal",
    "E": "connect",
    "F": "25+250 Hz",
    "G": "noise",
    "H": "stick on paper, 3 x 3 cells",
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recordings", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--part",
        choices=PARTS,
        nargs="*",
        default=list(PARTS[:-2]),
        help="only these parts (default all but kinds, receptors)",
    )
    parser.add_argument(
        "--plain-frames", type=int, default=60, help="frames of a sequence for the plain form (default 60)"
    )
    parser.add_argument("--length", type=float, default=1.0, help="factor for the length of all sequences (default 1)")
    parser.add_argument("--kinds", choices=KINDS, nargs="+", default=list(KINDS), help="only these kinds (default all)")
    parser.add_argument("--mode", choices=("best", "finest"), default="best", help="mode of the kinds (default best)")
    parser.add_argument("--keep", type=Path, help="folder for measured arrays, which are then reused")
    options = parser.parse_args()
    kernel = ", ".join(sorted({each["architecture"] for each in threadpool_info() if "numpy" in each["filepath"]}))
    print(f"{load()}; kernel {kernel}")
    with one_blas_thread():
        for part in options.part:
            {
                "paper": lambda: paper(options.plain_frames, 1.2 * options.length),
                "best": lambda: best(0.5 * options.length),
                "skin": skin,
                "jobs": lambda: jobs(options.length),
                "live": lambda: live(1.2 * options.length),
                "receptors": receptors,
                "kinds": lambda: kinds(options.kinds, options.mode, 0.3 * options.length, options.keep),
            }[part]()


def sequences(settings: Settings, seconds: float) -> Iterator[tuple[str, PressureFrames]]:
    """Pressure of the cells at the settings' rate, at rest at both ends."""
    for name, made, seed in (("chirp that wanders", wander, 31), ("rain", rain, 32), ("cloth", cloth, 33)):
        yield f"{name} (seed {seed})", resample_pressure(pressure_of(made(seconds, seed)), settings.target.rate)
    recording = sample("denim")
    change = float(np.abs(np.asarray(recording.samples) - np.median(recording.samples, axis=0)).max())
    # Like `midair import sample:denim --peak 30Pa` and `solve --band 0.5Hz 15Hz`, because it has only 36 frames/s.
    flat = Calibration.flat(recording.sensor, sensitivity=change / 30.0, unit=recording.unit)
    slow = calibrated_pressure(recording, flat, settings.but(band=(0.5, 15.0)))
    yield "sample:denim", slow.cut(3.0, seconds)


def wander(seconds: float, seed: int = 31) -> np.ndarray:
    """A spot of 9 mm on a random path at .1 m/s that vibrates with a frequency rising from 30 to 300 Hz."""
    rng, time_ = np.random.default_rng(seed), _time(seconds)
    x, y = (_slow(rng, len(time_), 2.0) * 12e-3 for _ in range(2))
    X, Y = np.meshgrid(SensorGrid().x, SensorGrid().y)
    spot = np.exp(-((X - x[:, None, None]) ** 2 + (Y - y[:, None, None]) ** 2) / (2 * 9e-3**2))
    wave = np.sin(2 * np.pi * (30 * time_ + 135 * time_**2 / seconds))
    return (spot * wave[:, None, None]).reshape(-1, 16)


def rain(seconds: float, seed: int = 32) -> np.ndarray:
    """Sixty drops per second on single cells, each a decaying wave of 80 to 250 Hz."""
    rng, time_ = np.random.default_rng(seed), _time(seconds)
    pressure = np.zeros((len(time_), 16))
    for at in rng.uniform(0, seconds, round(60 * seconds)):
        since = np.clip(time_ - at, 0, None)
        drop = np.exp(-since / 15e-3) * np.sin(2 * np.pi * rng.uniform(80, 250) * since)
        pressure[:, rng.integers(16)] += rng.uniform(0.3, 1.0) * drop
    return pressure


def cloth(seconds: float, seed: int = 33) -> np.ndarray:
    """Noise of 40 to 200 Hz that is correlated between neighbouring cells."""
    rng, time_ = np.random.default_rng(seed), _time(seconds)
    frequency = np.fft.rfftfreq(len(time_), 1 / RATE)
    spectrum = np.fft.rfft(rng.normal(size=(len(time_), 16)), axis=0)
    noise = np.fft.irfft(spectrum * ((frequency > 40) & (frequency < 200))[:, None], len(time_), axis=0)
    X, Y = (axis.reshape(-1) for axis in np.meshgrid(SensorGrid().x, SensorGrid().y))
    alike = np.exp(-((X[:, None] - X) ** 2 + (Y[:, None] - Y) ** 2) / (2 * 12e-3**2))
    return noise @ np.linalg.cholesky(alike + 1e-9 * np.eye(16)).T


def problem(pressure: PressureFrames, settings: Settings, strength: float) -> Problem:
    """Problem of the settings with the target's peak at a strength, without imperceptible frames."""
    grid, air = settings.target.grid, settings.acoustics
    focus = focus_amplitude(grid, ARRAY, acoustics=air)
    amplitude = np.asarray(target_amplitude(pressure, settings).amplitude)
    amplitude = amplitude[amplitude.max(axis=1) > 0.01 * amplitude.max()]
    guard = settings.solver.guard
    ring = None
    if isinstance(guard, Guard):
        G = transfer_matrix(guard.points(grid), ARRAY, acoustics=air) / focus
        ring = GuardField(G=G, ceiling=guard.ceiling, weight=guard.weight)
    amplitude = strength * amplitude / amplitude.max()
    return Problem(
        G=transfer_matrix(grid, ARRAY, acoustics=air) / focus,
        amplitude=amplitude,
        cells=Windows().target(amplitude, grid, 1.0) if settings.solver.fit == "windows" else None,
        psi=spreading_phase(grid, ARRAY, air.medium),
        guard=ring,
        position=ARRAY.position,
    )


def paper(plain_frames: int, seconds: float) -> None:
    """Glide, fast and the plain form in the paper's mode."""
    name, reference = plain(None)
    settings = paper_mode()
    for label, pressure in sequences(settings, seconds):
        asked = problem(pressure, settings, 0.1)
        frames = len(asked.amplitude)
        print(f"\npaper's mode, {label}, {frames} frames, strength .1; {load()}")
        heading("E mean", "E worst", "ms", "ratio", "rad step")
        few = replace(asked, amplitude=asked.amplitude[:plain_frames])
        theta, cost = timed(lambda few=few: warm(few, reference))
        base = cost / len(few.amplitude)
        _row(f"{name}, {len(few.amplitude)} frames", few, theta, base, base)
        for method in (Fast(), Glide()):
            answer, cost = timed(lambda method=method, asked=asked: method.solve(asked))
            _row(type(method).__name__.lower(), asked, answer.phase, cost / frames, base)


def best(seconds: float) -> None:
    """Glide and the former best mode at 4 kHz, and the time of bare products of the same shape."""
    settings = best_mode()
    for label, pressure in sequences(settings, seconds):
        asked = problem(pressure, settings, 0.15)
        frames = len(asked.amplitude)
        print(f"\nbest mode, {label}, {frames} frames, strength .15; {load()}")
        heading("E mean", "E worst", "ms", "ratio", "rad step")
        before = replace(asked, cells=None, guard=replace(asked.guard, ceiling=0.6), smooth=0.2)
        short = replace(before, amplitude=before.amplitude[:512])
        answer, cost = timed(lambda short=short: Fast().solve(short))
        base = cost / len(short.amplitude)
        _row(f"was, {len(short.amplitude)} frames", short, answer.phase, base, base)
        method = settings.solver.method
        answer, cost = timed(lambda method=method, asked=asked: method.solve(asked))
        _row("glide", asked, answer.phase, cost / frames, base)
        product = _product(asked, method)
        shown = f"{product:10.4f} ms; glide takes {cost / frames / product:.1f} times as long"
        print(f"{'one evaluation in bare products':36}{'':20}{shown}")


@contextmanager
def folded(folds: bool) -> Iterator[None]:
    """Solve within the block with folded arrays, or with whole ones."""
    known = Lattice.of
    Lattice.of = staticmethod(known if folds else lambda _: None)
    try:
        yield
    finally:
        Lattice.of = known


def skin() -> None:
    """Signal to distortion on the skin from the error budget, for the signals of the fidelity table."""
    plan = FidelityPlan()
    before = best_mode().but(
        method="fast", fit="points", smooth=0.2, guard=Guard(margin=25e-3, pitch=6e-3, ceiling=0.6)
    )
    print(f"\nbest mode, .12 s of each signal, strength .15, transducers of their own; {load()}")
    heading("SDR dB, was", "whole", "folded", "leak, was", "whole", "folded", "images, was", "whole", "folded")
    for thing in plan.things:
        made = []
        for settings, folds in ((before, True), (best_mode(), False), (best_mode(), True)):
            original = original_of(thing, plan, settings)
            alike = at_strength(original, settings, plan)
            with folded(folds):
                made.append(error_budget(original, BudgetPlan(settings=alike, rig=plan.rig, lead=required_lead(alike))))
        ratios = [each.stage("silencer").so_far.distortion_ratio for each in made]
        leaks = [each.stage("solver").leak.peak for each in made]
        images = [each.stage("silencer").so_far.images for each in made]
        line(thing, *ratios, *leaks, *images, digits="111222000")


def jobs(seconds: float) -> None:
    """About one second of a towel in the best mode with 1, 2 and 4 jobs: wall time, and equality of the results."""
    settings = best_mode()
    asked = problem(resample_pressure(stroke("towel"), settings.target.rate).cut(0.2, seconds), settings, 0.15)
    print(
        f"\nbest mode, {len(asked.amplitude)} frames of a towel: {len(asked.amplitude) / 4000:.2f} s of touch; {load()}"
    )
    heading("wall s", "CPU s")
    first = None
    for count in (1, 2, 4):
        method = replace(settings.solver.method, jobs=count)
        begin, cpu = time.perf_counter(), time.process_time()
        phase = method.solve(asked).phase
        line(f"{count} jobs", time.perf_counter() - begin, time.process_time() - cpu, digits="22")
        first = phase if first is None else first
        print(f"{'':36}identical to one job: {'yes' if np.array_equal(phase, first) else 'NO'}")


def live(seconds: float) -> None:
    """The live solver on three sequences."""
    settings = paper_mode()
    noise = problem(resample_pressure(pressure_of(_noise(seconds)), settings.target.rate), settings, 0.1)
    print(f"\nlive, 1 kHz, strength .1, E without the first ten frames; garbage collector off; {load()}")
    heading("E mean", "E worst", "CPU p50", "CPU p99", "p50 ms", "p99 ms")
    frames = round(1000 * seconds)
    spots = (
        ("spot", problem_of(moving_blob(frames), 0.1)),
        ("towel", towel(frames, 0.1)),
        (f"noise (seed {_NOISE})", noise),
    )
    for label, asked in spots:
        theta, wall, cpu = frame_times(Live(), asked)
        error = error_of(asked, theta)[asked.amplitude.any(axis=1)][10:]
        line(
            label,
            error.mean(),
            error.max(),
            *np.percentile(cpu, [50, 99]),
            *np.percentile(wall, [50, 99]),
            digits="442222",
        )


def kinds(chosen: list[str], mode: Mode, seconds: float, keep: Path | None) -> None:
    """Signal to distortion of touched cells and of all cells, by array, for eight kinds of recordings."""
    settings = MODES[mode]()
    room = VirtualRig(acoustics=settings.acoustics)
    alike = Transducers.alike(room.array.count, settings.compensation.dynamics)
    arrays = {"as modelled": replace(room, transducers=alike)}
    arrays |= {f"unknown {seed}": replace(room, seed=seed) for seed in (0, 7, 11)}
    arrays |= {"unknown, boards": replace(room, spread="boards")}
    print(f"dB: touched cells / all cells on the skin; at the sensor with / without its noise; {load()}")
    print("| | | " + " | ".join([*arrays, "measured 0", "at the sensor", "CPU s"]) + " |\n" + "| --- " * 10 + "|")
    for kind in chosen:
        start, plan = time.process_time(), FidelityPlan(duration=seconds, rig=room)
        found = real_pressure(KINDS[kind], settings, seconds)
        original = original_of(KINDS[kind], plan, settings) if found is None else found
        asked = at_strength(original, settings, plan)
        lead = required_lead(asked)
        made = reproduce(add_lead(original, lead), room.array, asked)
        cells = [on_skin(original, made, replace(rig, cells=original.sensor)) for rig in arrays.values()]
        calibration = kept(room, 8.0, keep)
        played = BudgetPlan(
            settings=asked.measured(calibration),
            rig=replace(room, cells=original.sensor),
            lead=lead,
            measured=calibration.applied(room.array),
        )
        measured = error_budget(original, played)
        skin, sensor = (measured.stage(stage).so_far for stage in ("silencer", "sensor"))
        clean = sensor.ratios[f"{TOUCHED}, without noise"][0]
        cells += [
            f"{skin.distortion_ratio:.1f} / {skin.overall_ratio:.1f}",
            f"{sensor.distortion_ratio:.1f} / {clean:.1f}",
        ]
        print(f"| {kind} | {KINDS[kind]} | {' | '.join(cells)} | {time.process_time() - start:.0f} |", flush=True)


def press(rate: float = 1000.0) -> PressureFrames:
    """A synthetic press, not a measurement: a disc of 20 mm with a mean of 40 Pa for .5 s, a tremor of 8 Hz, a tap.

    The tremor has 5 % of the mean; the tap at first contact is 10 Pa of 180 Hz that decays within 15 ms.
    """
    time_, (x, y) = np.arange(round(rate)) / rate, np.meshgrid(SensorGrid().x, SensorGrid().y)
    rise = np.clip(np.minimum(time_ - 0.15, 0.85 - time_) / 0.15, 0, 1)
    since = np.clip(time_ - 0.15, 0, None)
    wave = 40 * (1 - np.cos(np.pi * rise)) / 2 * (1 + 0.05 * np.sin(2 * np.pi * 8 * time_))
    wave += (since > 0) * 10 * np.exp(-since / 15e-3) * np.sin(2 * np.pi * 180 * since)
    disc = np.clip((15e-3 - np.hypot(x, y)) / 10e-3, 0, 1)
    origin = Provenance(source="virtual:press", simulated=True)
    return PressureFrames(pressure=wave[:, None, None] * disc, rate=rate, band=(0.0, 470.0), provenance=origin)


def receptors() -> None:
    """Bands of the force on all cells that were recorded, wanted and played, in mN, and the level of the drive."""
    rig, base = VirtualRig(), MODES["quiet"]().but(rate=1000.0, band=(0.0, 470.0), ears=None)
    air = base.acoustics
    skin, profile = rig.skin(), profile_named(DEFAULT_PROFILE)
    weights = cell_weights(rig.sensor_model, skin.points, between="waves")
    G = transfer_matrix(skin.points, rig.array, acoustics=air)
    print(
        "| touch | drawn by | recorded | wanted | played | peak Pa | ears dB | Pa at 110 dB | CPU s |\n"
        + "|---" * 9
        + "|"
    )
    for name in ("towel", "sponge", "press"):
        found = press() if name == "press" else replace(stroke(name), band=(0.0, 470.0)).cut(0.3, 0.7)
        asked = add_lead(found, 0.2)
        middle = slice(200, asked.frames - 200)
        for how in ("slow-bias", "receptors", "one focus"):
            start = time.process_time()
            settings = base.but(mapping="slow-bias" if how == "slow-bias" else "receptors")
            settings = settings if how == "slow-bias" else settings.but(circle=Circle())
            wanted = MAPPINGS[settings.target.mapping](asked.pressure, asked.rate)
            drive = (
                one_focus(asked, rig, air)
                if how == "one focus"
                else reproduce(asked, rig.array, settings).solution.drive
            )
            cells = simulate(drive, G, chain=rig.array_device().chain, rate=skin.rate, acoustics=air, weights=weights)
            played = resample(cells, skin.rate, asked.rate)[: asked.frames]
            parts = " | ".join(
                bands(each.reshape(asked.frames, -1), middle) for each in (asked.pressure, wanted, played)
            )
            ears = [number for number, place in enumerate(profile.places) if not place.name.startswith("palm")]
            level = float(measure_exposure(drive, rig.array, profile, room=air.medium).level[:, ears].max())
            part = min(1.0, 10 ** ((110 - level) / 10))
            peak, spent = wanted.max(), time.process_time() - start
            print(
                f"| {name} | {how} | {parts} | {peak:.0f} | {level:.0f} | {part * peak:.1f} | {spent:.0f} |",
                flush=True,
            )


def bands(cells: np.ndarray, middle: slice) -> str:
    """Mean of the force in mN, and its rms from 10 to 60 Hz and above."""
    force = 1e3 * SensorGrid().pitch ** 2 * cells.sum(axis=1, keepdims=True)
    slow, fast, pacinian = (each[middle] for each in receptor_levels(force, 1000.0))
    return f"{slow.mean():.1f} / {np.sqrt((fast**2).mean() / 2):.2f} / {np.sqrt((pacinian**2).mean() / 2):.2f}"


def one_focus(asked: PressureFrames, rig: VirtualRig, air: Acoustics) -> Drive:
    """One focus on an orbit around the centre of pressure, with the pressure of the strongest cell."""
    cells = asked.pressure.reshape(asked.frames, -1)
    slow, fast, pacinian = receptor_levels(cells.max(axis=1, keepdims=True), asked.rate)
    time_, load_ = np.arange(asked.frames)[:, None] / asked.rate, np.maximum(cells, 0) + 1e-6
    x, y = (axis.ravel() for axis in np.meshgrid(asked.sensor.x, asked.sensor.y))
    centre = np.stack([load_ @ x, load_ @ y], axis=1) / load_.sum(axis=1, keepdims=True)
    centre = gaussian_filter1d(centre, 0.05 * asked.rate, axis=0)
    place = np.column_stack([centre + Circle().offset(time_[:, 0]), np.full(asked.frames, rig.height)])
    pressure = receptor_pressure(np.maximum(slow - fast - pacinian, 0), 2 * fast, 2 * pacinian, time_)
    return draw(Foci(position=place[:, None], pressure=pressure, rate=asked.rate), rig.array, acoustics=air).drive


def on_skin(original: PressureFrames, made: Reproduction, rig: VirtualRig) -> str:
    """Signal to distortion of touched cells and of all cells, without a sensor, as in the error budget."""
    drive, asked, skin = made.solution.drive, made.pressure, rig.skin()
    around = rig.acoustics or drive.acoustics
    G = transfer_matrix(skin.points, rig.array, acoustics=around)
    weights = cell_weights(rig.sensor_model, skin.points, between="waves")
    pressure = simulate(drive, G, chain=rig.array_device().chain, rate=skin.rate, acoustics=around, weights=weights)
    # A sample is the end of its interval; the first frame begins in silence.
    cells = np.concatenate([np.zeros_like(pressure[:1]), pressure[:-1]]).reshape(-1, *asked.sensor.shape)
    output = StageOutput(name="skin", what="", pressure=replace(asked, pressure=cells, rate=skin.rate))
    part = ((asked.frames - original.frames) / 2 / asked.rate, original.frames / original.rate)
    found = budget(asked, [output], strength=made.strength(), judged=part).stages[0].so_far
    return f"{found.distortion_ratio:.1f} / {found.overall_ratio:.1f}"


_NOISE = 34


def _noise(seconds: float, seed: int = _NOISE) -> np.ndarray:
    """Independent noise of 25 to 460 Hz on every cell."""
    rng, frames = np.random.default_rng(seed), round(seconds * RATE)
    frequency = np.fft.rfftfreq(frames, 1 / RATE)
    spectrum = np.fft.rfft(rng.normal(size=(frames, 16)), axis=0)
    return np.fft.irfft(spectrum * ((frequency > 25) & (frequency < 460))[:, None], frames, axis=0)


def _time(seconds: float) -> np.ndarray:
    return np.arange(round(seconds * RATE)) / RATE


def _slow(rng: np.random.Generator, frames: int, highest: float) -> np.ndarray:
    """A random path below a frequency, between -1 and 1."""
    path = resample(rng.normal(size=(max(round(2 * highest * frames / RATE), 4), 1)), 2 * highest, RATE)[:frames, 0]
    path = np.pad(path, (0, frames - len(path)), mode="edge")
    return path / np.abs(path).max()


def pressure_of(samples: np.ndarray) -> PressureFrames:
    """Scale to a peak of 20 Pa, with a fade at both ends."""
    time_ = np.arange(len(samples)) / RATE
    fade = np.clip(np.minimum(time_, time_[-1] - time_) / 0.1, 0, 1)[:, None]
    pressure = (20 * samples / np.abs(samples).max() * fade).reshape(-1, 4, 4)
    origin = Provenance(source="virtual:benchmark", simulated=True)
    return PressureFrames(pressure=pressure, rate=RATE, sensor=SensorGrid(), provenance=origin)


def _product(asked: Problem, method: Glide) -> float:
    """Milliseconds per frame of the four products of one cost and its gradient, in batches of glide's size."""
    machine = FieldOperators.of(
        asked, backend("numpy"), tolerance=method.tolerance, memory=method.memory, outside=method.outside
    )
    rows = method.rows or machine.backend.rows
    q = np.ones((rows, machine.drive.shape[1]), np.complex64)
    y = np.ones((rows, machine.field.shape[1]), np.complex64)

    def once() -> None:
        machine.drive.to_modes(q) @ machine.field
        machine.drive.of_modes(y @ machine.field_back)

    return fastest(once) / rows


def _row(label: str, asked: Problem, theta: np.ndarray, cost: float, base: float) -> None:
    error = error_of(asked, theta)
    change = np.angle(np.exp(1j * np.diff(theta, axis=0)))
    line(label, error.mean(), error.max(), cost, base / cost, float(np.sqrt((change**2).mean())), digits="44313")


if __name__ == "__main__":
    main()
