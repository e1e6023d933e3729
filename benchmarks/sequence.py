"""Sequences of frames: error, time and phase change; and the error of the live solver over its time budget."""

from __future__ import annotations

import numpy as np

from benchmarks.clock import frame_times, heading, line, load, timed
from benchmarks.yardstick import Plain
from midair.solvers import Live, Problem, error_of, solver

BUDGETS = ((2, 3), (3, 6), (5, 9), (7, 9), (8, 12), (10, 16), (20, 40))


def sequence(label: str, problem: Problem, name: str, reference: Plain, methods: list[str], plain_frames: int) -> None:
    """Print a table; the plain form solves only the first frames, because it needs a quarter of a second for each."""
    sounding = problem.amplitude.any(axis=1)
    print(f"\n{label}, {int(sounding.sum())} sounding frames; E without the first ten; {load()}")
    heading("E mean", "E worst", "ms", "ratio", "CPU p50", "CPU p99", "p50 ms", "p99 ms", "p99.9 ms", "rad step")
    short = Problem(G=problem.G, amplitude=problem.amplitude[:plain_frames], psi=problem.psi)
    heard = sounding[:plain_frames]
    theta, base = timed(lambda: warm(short, reference))
    base /= heard.sum()
    _line(f"{name}, 50 then 20, {plain_frames} frames", short, theta, base, 1.0)
    for method in [method for method in ("lm", "fast", "live") if method in methods]:
        these = short if method == "lm" else problem
        settings = solver(method)
        answer, cost = timed(lambda settings=settings, these=these: settings.solve(these))
        cost /= these.amplitude.any(axis=1).sum()
        clock = frame_times(settings, problem)[1:] if isinstance(settings, Live) else None
        ending = f", {plain_frames} frames" if these is short else ""
        _line(f"{method}{ending}", these, answer.phase, cost, base / cost, clock)


def budget(label: str, problem: Problem) -> None:
    """Print E of the live solver over its time per frame."""
    print(f"\nlive, E over the time per frame, {label}; garbage collector off; {load()}")
    heading("E mean", "E worst", "CPU least", "CPU p50", "CPU p99", "p50 ms", "p99 ms", "p99.9 ms")
    for field, lift in BUDGETS:
        theta, wall, cpu = frame_times(Live(warm_iterations=field, warm_lift_iterations=lift), problem)
        error = _later(problem, theta)
        times = (cpu.min(), *_percentiles(wall, cpu))
        line(f"{field} field, {lift} lift iterations", error.mean(), error.max(), *times, digits="44222222")


def warm(problem: Problem, reference: Plain) -> np.ndarray:
    """The paper's sequence: 50 iterations, then 20 from the previous frame."""
    x, phases = None, []
    for p in problem.amplitude:
        if p.any():
            x = reference(problem.G, p, 50 if x is None else 20, x)
        phases.append(np.zeros(problem.transducers) if x is None else x[: problem.transducers])
    return np.stack(phases)


def _percentiles(wall: np.ndarray, cpu: np.ndarray) -> np.ndarray:
    """50 and 99 % of the CPU time, and 50, 99 and 99.9 % of the wall time, in ms."""
    return np.concatenate([np.percentile(cpu, [50, 99]), np.percentile(wall, [50, 99, 99.9])])


def _line(
    label: str,
    problem: Problem,
    theta: np.ndarray,
    cost: float,
    ratio: float,
    clock: tuple[np.ndarray, np.ndarray] | None = None,
) -> None:
    error = _later(problem, theta)
    times = [None] * 5 if clock is None else _percentiles(*clock)
    line(label, error.mean(), error.max(), cost, ratio, *times, _step(problem, theta), digits="4421222222")


def _later(problem: Problem, theta: np.ndarray) -> np.ndarray:
    return error_of(problem, theta)[problem.amplitude.any(axis=1)][10:]


def _step(problem: Problem, theta: np.ndarray) -> float:
    """Rms change of phase between consecutive frames with sound, in rad."""
    sounding = problem.amplitude.any(axis=1)
    change = np.angle(np.exp(1j * np.diff(theta, axis=0)))[sounding[1:] & sounding[:-1]]
    return float(np.sqrt((change**2).mean()))
