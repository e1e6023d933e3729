"""Independent patterns: error, time, ratio to the plain form, and distance to the lowest known error."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from benchmarks.clock import heading, line, timed
from benchmarks.published import PUBLISHED
from benchmarks.targets import binary, problem_of
from benchmarks.yardstick import Plain
from midair.solvers import Problem, error_of, solver

TABLE = Path(__file__).with_name("floors.json")


def floors(bits: list[int], strength: float) -> np.ndarray | None:
    """Lowest known E of each pattern, shape (pattern,); None if one of them is not in the table."""
    known = json.loads(TABLE.read_text()).get(f"{strength:g}", {})
    names = [f"{one:#06x}" for one in bits]
    return np.array([known[name] for name in names]) if all(name in known for name in names) else None


def static(strength: float, bits: list[int], name: str, reference: Plain, methods: list[str]) -> None:
    print(f"\n{len(bits)} patterns, strength {strength}; each pattern on its own")
    heading("E mean", "E worst", "x floor", "ms", "ratio")
    problem, floor = problem_of(binary(bits), strength), floors(bits, strength)
    count = len(bits)
    theta, base = timed(
        lambda: np.stack([reference(problem.G, p, 50, None)[: problem.transducers] for p in problem.amplitude])
    )
    _line(f"{name}, 50 iterations", error_of(problem, theta), floor, base / count, 1.0)
    for method in [method for method in methods if method != "live"]:
        settings = PUBLISHED[method]() if method in PUBLISHED else solver(method, start="zero")
        settings.solve(Problem(G=problem.G, amplitude=problem.amplitude[:1], psi=problem.psi))
        answer, cost = timed(lambda settings=settings: settings.solve(problem))
        error = error_of(problem, answer.phase, answer.level)
        _line(f"{method}, {int(answer.iterations.max())} iterations", error, floor, cost / count, base / cost)
    if "fast" in methods:
        many = problem_of(np.tile(binary(bits), (1 + 1000 // count, 1)), strength)
        answer, cost = timed(lambda: solver("fast").solve(many))
        each = cost / len(many.amplitude)
        error = error_of(many, answer.phase)[:count]
        _line(f"fast, {len(many.amplitude)} at once", error, floor, each, base / count / each)


def _line(label: str, error: np.ndarray, floor: np.ndarray | None, cost: float, ratio: float) -> None:
    distance = None if floor is None else error.mean() / floor.mean()
    line(label, error.mean(), error.max(), distance, cost, ratio, digits="44221")
