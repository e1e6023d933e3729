"""Lowest known error of each pattern of the benchmark; `python -m benchmarks.floors` computes the table again.

Six initial phases of the field (lenses of several strengths, and none), each followed by 600 iterations of the batch
solver; the best result is refined by 150 Levenberg-Marquardt steps in the modes above .1 %. The error is the lowest one
found, not a bound: a better solution may exist.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.targets import binary, patterns, problem_of, towel
from midair.solvers import Exact, Fast, Problem, error_of, one_blas_thread
from midair.solvers.exact import System, state_at
from midair.solvers.modes import modes

TABLE = Path(__file__).with_name("floors.json")
LENSES = (0.0, 0.7, 0.85, 1.0, 1.2, -1.0)


def floors(bits: list[int], strength: float) -> np.ndarray | None:
    """Lowest known E of each pattern, shape (pattern,); None if one of them is not in the table."""
    known = json.loads(TABLE.read_text()).get(f"{strength:g}", {}) if TABLE.exists() else {}
    names = [f"{one:#06x}" for one in bits]
    return np.array([known[name] for name in names]) if all(name in known for name in names) else None


def least(problem: Problem) -> np.ndarray:
    """Lowest error found for each target, shape (frame,)."""
    theta, error = None, np.full(len(problem.amplitude), np.inf)
    for lens in LENSES:
        trial = Fast(iterations=300, more_iterations=300).solve(replace(problem, psi=lens * problem.psi)).phase
        found = error_of(problem, trial)
        theta = trial if theta is None else np.where((found < error)[:, None], trial, theta)
        error = np.minimum(found, error)
    return np.minimum(error, error_of(problem, _polished(problem, theta, 150)))


def _towel(frames: int) -> None:
    whole = towel(1200, 0.1)
    some = replace(whole, amplitude=whole.amplitude[np.linspace(10, 1199, frames).astype(int)])
    with one_blas_thread():
        usual = error_of(some, Fast().solve(some).phase)
        found = least(some)
    print(f"{frames} frames of the towel stroke, strength 0.1: fast E mean {usual.mean():.4f}, worst {usual.max():.4f}")
    print(f"least E mean {found.mean():.4f}, worst {found.max():.4f}")


def _polished(problem: Problem, theta: np.ndarray, steps: int) -> np.ndarray:
    system, method = System.of(modes(problem.G, tolerance=1e-3), problem.level, "single"), Exact()
    ends = []
    for p, first in zip(problem.amplitude, theta, strict=True):
        psi = np.where(p > 0, np.angle(problem.field(first[None])[0]), 0.0)
        state = state_at(system, p, np.concatenate([first, psi]), 1e-3 * float((p**2).max()))
        while state.status is None and state.iterations < steps:
            state = method.step(system, p, state)
        ends.append(state.x[: problem.transducers])
    return np.stack(ends)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.floors", description=__doc__.splitlines()[0])
    parser.add_argument("--others", type=int, default=30, help="number of random patterns besides the ten (default 30)")
    parser.add_argument("--seed", type=int, default=2024, help="seed of the random patterns (default 2024)")
    parser.add_argument(
        "--towel", type=int, metavar="FRAMES", help="print the error of this many frames of the towel stroke instead"
    )
    options = parser.parse_args()
    if options.towel is not None:
        _towel(options.towel)
        return
    bits, table = patterns(options.others, options.seed), {}
    with one_blas_thread():
        for strength in (0.1, 0.2):
            found = least(problem_of(binary(bits), strength))
            table[f"{strength:g}"] = {f"{one:#06x}": round(float(E), 5) for one, E in zip(bits, found, strict=True)}
            print(f"strength {strength}: least E mean {found.mean():.4f}, worst {found.max():.4f}", flush=True)
    TABLE.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
