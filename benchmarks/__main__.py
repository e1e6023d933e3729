"""Print, for the same targets, thread setting and run: error and time of each solver, and its ratio to the plain one.

Times are CPU times of this process on one BLAS thread, so that a busy machine does not change the ratios much; the
live solver's frames are also timed by the clock. Set-up (the factor of G) is included in every figure.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from benchmarks.targets import beating_blob, binary, moving_blob, patterns, problem_of
from benchmarks.yardstick import Plain, plain
from midair.solve import METHODS, Live, Problem, one_blas_thread, relative_error, solver


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.splitlines()[0])
    ask.add_argument("--others", type=int, default=30, help="random patterns beside the ten (default 30)")
    ask.add_argument("--seed", type=int, default=2024, help="that the random patterns are drawn with (default 2024)")
    ask.add_argument("--part", choices=("static", "sequence", "live"), help="only this part (default all three)")
    ask.add_argument("--frames", type=int, default=200, help="frames of a sequence (default 200)")
    ask.add_argument(
        "--yardstick", help="file with paper_lm (default $MIDAIR_YARDSTICK, ../shared/baseline/paper_lm.py)"
    )
    ask.add_argument("--methods", nargs="*", default=list(METHODS), help="which solvers (default all)")
    said = ask.parse_args()
    name, reference = plain(said.yardstick)
    with one_blas_thread():
        if said.part in (None, "static"):
            for strength in (0.1, 0.2):
                static(strength, patterns(said.others, said.seed), name, reference, said.methods)
        if said.part in (None, "sequence"):
            for label, channels in (("moving blob", moving_blob), ("beating blob", beating_blob)):
                sequence(label, problem_of(channels(said.frames), 0.1), name, reference, said.methods)
        if said.part in (None, "live"):
            budget(problem_of(moving_blob(said.frames), 0.1))


def static(strength: float, bits: list[int], name: str, reference: Plain, methods: list[str]) -> None:
    print(f"\n{len(bits)} patterns, strength {strength}; each pattern on its own")
    print(f"{'':34}{'E mean':>9}{'E worst':>9}{'ms/pattern':>12}{'ratio':>8}")
    problem = problem_of(binary(bits), strength)
    theta, base = timed(
        lambda: np.stack([reference(problem.G, p, 50, None)[: problem.transducers] for p in problem.amplitude])
    )
    row(f"{name}, 50 iterations", relative_error(problem, theta), base / len(bits), 1.0)
    for method in methods:
        if method == "live":
            continue
        settings = solver(method, start="zero")
        settings.solve(Problem(G=problem.G, amplitude=problem.amplitude[:1], psi=problem.psi))
        answer, cost = timed(lambda settings=settings: settings.solve(problem))
        error = relative_error(problem, answer.phase, answer.level)
        row(f"{method}, {int(answer.iterations.max())} iterations", error, cost / len(bits), base / cost)
    if "fast" in methods:
        many = problem_of(np.tile(binary(bits), (1 + 1000 // len(bits), 1)), strength)
        answer, cost = timed(lambda: solver("fast").solve(many))
        frames = len(many.amplitude)
        row(
            f"fast, {frames} at once",
            relative_error(many, answer.phase),
            cost / frames,
            base / len(bits) * frames / cost,
        )


def sequence(label: str, problem: Problem, name: str, reference: Plain, methods: list[str]) -> None:
    sounding = problem.amplitude.any(axis=1)
    frames = int(sounding.sum())
    print(f"\n{label}, {frames} sounding frames, strength 0.1; E without the first ten")
    print(f"{'':34}{'E mean':>9}{'E worst':>9}{'ms/frame':>12}{'ratio':>8}", end="")
    print(f"{'p50 ms':>9}{'p99 ms':>9}{'p99.9':>9}{'step rad':>10}")
    theta, base = timed(lambda: warm(problem, reference))
    row(f"{name}, 50 then 20", _later(problem, theta, sounding), base / frames, 1.0, step=_step(theta, sounding))
    for method in [method for method in ("lm", "exact", "fast", "live") if method in methods]:
        settings = solver(method)
        answer, cost = timed(lambda settings=settings: settings.solve(problem))
        error, step = _later(problem, answer.phase, sounding), _step(answer.phase, sounding)
        clock = by_the_clock(settings, problem)[1] if isinstance(settings, Live) else None
        row(method, error, cost / frames, base / cost, clock, step)


def budget(problem: Problem) -> None:
    print("\nlive: E over time a frame, moving blob")
    print(f"{'':34}{'E mean':>9}{'E worst':>9}{'':12}{'':8}{'p50 ms':>9}{'p99 ms':>9}{'p99.9':>9}")
    sounding = problem.amplitude.any(axis=1)
    for field, lift in ((5, 3), (10, 5), (16, 8), (24, 12), (40, 20), (80, 40)):
        theta, clock = by_the_clock(Live(warm_iterations=field, warm_lift_iterations=lift), problem)
        row(f"{field} field, {lift} lift iterations", _later(problem, theta, sounding), None, None, clock)


def warm(problem: Problem, reference: Plain) -> np.ndarray:
    """The paper's sequence: 50 iterations, then 20 from the frame before."""
    x, phases = None, []
    for p in problem.amplitude:
        if p.any():
            x = reference(problem.G, p, 50 if x is None else 20, x)
        phases.append(np.zeros(problem.transducers) if x is None else x[: problem.transducers])
    return np.stack(phases)


def by_the_clock(settings: Live, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Phases, and wall time of each sounding frame after the first, in ms."""
    follower, phases, times = settings.begin(problem), [], []
    for p in problem.amplitude:
        start = time.perf_counter()
        phases.append(follower.follow(p))
        if p.any():
            times.append(1e3 * (time.perf_counter() - start))
    return np.stack(phases), np.array(times[1:])


def timed(work: Callable[[], object]) -> tuple:
    """What it returns, and the CPU time it took, in ms."""
    start = time.process_time()
    result = work()
    return result, 1e3 * (time.process_time() - start)


def row(label, error, cost, ratio, clock=None, step=None) -> None:
    line = f"{label:34}{error.mean():9.4f}{error.max():9.4f}"
    line += f"{cost:12.2f}{ratio:8.1f}" if cost is not None else " " * 20
    if clock is not None:
        line += "".join(f"{value:9.2f}" for value in np.percentile(clock, [50, 99, 99.9]))
    elif step is not None:
        line += " " * 27
    print(line + (f"{step:10.2f}" if step is not None else ""), flush=True)


def _later(problem: Problem, theta: np.ndarray, sounding: np.ndarray) -> np.ndarray:
    return relative_error(problem, theta)[sounding][10:]


def _step(theta: np.ndarray, sounding: np.ndarray) -> float:
    """Root mean square change of phase from one sounding frame to the next, in rad."""
    change = np.angle(np.exp(1j * np.diff(theta, axis=0)))[sounding[1:] & sounding[:-1]]
    return float(np.sqrt((change**2).mean()))


if __name__ == "__main__":
    main()
