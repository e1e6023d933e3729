"""Solvers of whole recordings: `python -m benchmarks.recordings`, on sequences that were not used for tuning.

Three random sequences with fixed seeds, and the package's denim sample, with midair's own mapping from pressure to
targets. Paper's mode: 1 kHz, strength .1; the plain form of the paper's method solves only the first frames. Best mode:
4 kHz, strength .15, guard. One run, one BLAS thread. `was` is the former best mode: `fast`, 320 iterations, --smooth
0.2, a ceiling of .6.
Times are CPU times of this process including set-up, except for those labelled wall.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_info

from benchmarks.clock import fastest, heading, line, load, timed
from benchmarks.sequence import warm
from benchmarks.targets import ARRAY
from benchmarks.yardstick import plain
from midair.datasets import sample, stroke
from midair.dsp import resample
from midair.model import Calibration, PressureFrames, Provenance, SensorGrid
from midair.physics import focus_amplitude, transfer_matrix
from midair.pipeline import (
    calibrated_pressure,
    resample_pressure,
    target_amplitude,
)
from midair.settings import Settings, best_mode, paper_mode
from midair.solvers import Fast, Glide, Guard, Problem, Windows, error_of, one_blas_thread, spreading_phase
from midair.solvers.backend import backend
from midair.solvers.field_operators import FieldOperators
from midair.solvers.problem import GuardField

RATE = 8000.0
PARTS = ("paper", "best", "jobs")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recordings", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--part",
        choices=PARTS,
        nargs="*",
        default=list(PARTS),
        help="only these parts (default all)",
    )
    parser.add_argument(
        "--plain-frames", type=int, default=60, help="frames of a sequence for the plain form (default 60)"
    )
    parser.add_argument("--length", type=float, default=1.0, help="factor for the length of all sequences (default 1)")
    options = parser.parse_args()
    kernel = ", ".join(sorted({each["architecture"] for each in threadpool_info() if "numpy" in each["filepath"]}))
    print(f"{load()}; kernel {kernel}")
    with one_blas_thread():
        for part in options.part:
            {
                "paper": lambda: paper(options.plain_frames, 1.2 * options.length),
                "best": lambda: best(0.5 * options.length),
                "jobs": lambda: jobs(options.length),
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
    name, reference = plain()
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
        machine.field.of_modes(machine.drive.to_modes(q))
        machine.drive.of_modes(machine.field.to_modes(y))

    return fastest(once) / rows


def _row(label: str, asked: Problem, theta: np.ndarray, cost: float, base: float) -> None:
    error = error_of(asked, theta)
    change = np.angle(np.exp(1j * np.diff(theta, axis=0)))
    line(label, error.mean(), error.max(), cost, base / cost, float(np.sqrt((change**2).mean())), digits="44313")


if __name__ == "__main__":
    main()
