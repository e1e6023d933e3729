"""Benefit and cost of each term of the solvers: `python -m benchmarks.terms`.

Ten patterns at two strengths, point sources in air without attenuation, 200 mm, 996 transducers. E is that of the 256
points; "cells" is the error of the pressure on 16 cells; "ring" and "beyond" are the loudest sound over the target's
peak on a grid of 2.5 mm, up to 20 mm outside the square and from there to 150 mm from its centre (mean and maximum over
the patterns); "power" is the mean of |q|^2 over full drive. Times are CPU times with one BLAS thread, including set-up.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from benchmarks.targets import AIR, ARRAY, GRID, TEN, beating_blob, binary, moving_blob, problem_of
from midair.model import Acoustics, ControlGrid
from midair.physics import quantise_phase, transfer_matrix
from midair.solvers import (
    Cells,
    Fast,
    Guard,
    LevenbergMarquardt,
    Problem,
    Solver,
    automatic_level,
    error_of,
    one_blas_thread,
)
from midair.solvers.problem import GuardField
from midair.solvers.terms.amplitudes import doubled, halves

PLANE = ControlGrid(rows=121, columns=121, pitch=2.5e-3)
EDGE = 27.5e-3 + GRID.pitch / 2


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.terms", description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=("static", "sequence", "bits"), help="only this part (default all three)")
    parser.add_argument("--only", default="", help="only rows of patterns whose name contains this text (default all)")
    parser.add_argument("--strengths", type=float, nargs="+", default=[0.05, 0.15], help="strengths of the patterns")
    parser.add_argument("--backend", default="numpy", help="backend of the method fast (default numpy)")
    parser.add_argument("--frames", type=int, default=200, help="frames of a sequence (default 200)")
    options = parser.parse_args()
    fast = Fast(backend=options.backend)
    with one_blas_thread():
        for strength in options.strengths if options.part in (None, "static") else ():
            static(strength, fast, options.only)
        for label, channels in (("moving", moving_blob), ("beating", beating_blob)):
            if options.part in (None, "sequence"):
                sequence(label, problem_of(channels(options.frames), 0.1), fast)
        for strength in options.strengths if options.part in (None, "bits") else ():
            bits(strength, fast)


def static(strength: float, fast: Fast, only: str = "") -> None:
    print(f"\nten patterns, strength {strength}")
    print(f"{'':44}{'E mean':>8}{'worst':>7}{'cells':>8}{'ring':>7}{'worst':>6}{'beyond':>8}{'worst':>6}", end="")
    print(f"{'power':>7}{'ms':>8}")
    plain = problem_of(binary(list(TEN)), strength)
    look = _Looking(1 / _focus())
    near, wide = Guard(), Guard(margin=80e-3, pitch=6e-3)
    level = automatic_level(plain.amplitude)
    cells = replace(plain, cells=Cells().target(plain.amplitude, GRID, 1.0))
    rows: list[tuple[str, Problem, Solver, bool]] = [
        ("fast", plain, fast, False),
        ("fast, guard 20 mm", guarded(plain, near), fast, False),
        ("fast, guard 40 mm", guarded(plain, Guard(margin=40e-3)), fast, False),
        ("fast, guard 80 mm at 6 mm", guarded(plain, wide), fast, False),
        ("fast, bounded", plain, fast, True),
        ("fast, bounded, guard 20 mm", guarded(plain, near), fast, True),
        ("fast, bounded, guard 80 mm at 6 mm", guarded(plain, wide), fast, True),
        (f"fast, level auto ({level:.2f})", replace(plain, level=level), fast, False),
        (f"fast, level auto ({level:.2f}), guard 20 mm", replace(guarded(plain, near), level=level), fast, False),
        ("fast, cells", cells, fast, False),
        ("fast, cells, guard 20 mm", guarded(cells, near), fast, False),
        ("lm, 50 iterations", plain, LevenbergMarquardt(start="zero"), False),
        ("lm, guard 20 mm", guarded(plain, near), LevenbergMarquardt(start="zero"), False),
        ("lm, bounded", plain, LevenbergMarquardt(start="zero"), True),
    ]
    for label, problem, method, bounded in (row for row in rows if only in row[0]):
        theta, level, cost = solved(problem, method, bounded)
        look.print(label, problem, theta, level, cost / len(theta))


def sequence(label: str, problem: Problem, fast: Fast) -> None:
    sounding = problem.amplitude.any(axis=1)
    print(f"\n{label} blob, strength 0.1, {int(sounding.sum())} sounding frames; E without the first ten")
    print(f"{'':44}{'E mean':>8}{'worst':>7}{'step rad':>10}{'1 - cos':>9}{'ms':>8}")
    weights = (0.0, 1e-3, 3e-3, 1e-2, 3e-2)
    rows = [(f"fast, smooth {mu:g}", replace(problem, smooth=mu), fast) for mu in weights]
    rows.append(("lm, 50 then 20 iterations", problem, LevenbergMarquardt()))
    for name, asked, method in rows:
        theta, _, cost = solved(asked, method, False)
        error = error_of(problem, theta)[sounding][10:]
        change = np.angle(np.exp(1j * np.diff(theta, axis=0)))[sounding[1:] & sounding[:-1]]
        line = f"{name:44}{error.mean():8.4f}{error.max():7.4f}{np.sqrt((change**2).mean()):10.3f}"
        print(line + f"{(1 - np.cos(change)).mean():9.4f}{cost / sounding.sum():8.1f}", flush=True)


def bits(strength: float, fast: Fast) -> None:
    print(f"\nten patterns, strength {strength}: E mean / worst after rounding the phases of fast")
    problem = problem_of(binary(list(TEN)), strength)
    theta, _, _ = solved(problem, fast, False)
    for name, phase in [("not rounded", theta), *((f"{n} bits", quantise_phase(theta, bits=n)) for n in (8, 6, 4, 3))]:
        error = error_of(problem, phase)
        print(f"{name:44}{error.mean():8.4f}{error.max():7.4f}", flush=True)


class _Looking:
    """Field of a drive on the wide plane, in the units of a problem."""

    def __init__(self, scale: float) -> None:
        G = transfer_matrix(PLANE, ARRAY, acoustics=Acoustics(medium=AIR, directivity="point"))
        self.G = (scale * G).astype(np.complex64)
        away = np.abs(PLANE.position[:, :2]).max(axis=1)
        self.parts = [(away > EDGE) & (away <= 47.5e-3 + 1e-6), away > 47.5e-3 + 1e-6]

    def print(self, label: str, problem: Problem, theta: np.ndarray, level: np.ndarray | None, cost: float) -> None:
        part = np.ones_like(theta) if level is None else level
        error = error_of(replace(problem, cells=None), theta, part)
        q = (problem.level * part * np.exp(1j * theta)).astype(np.complex64)
        cells = Cells().target(problem.amplitude, GRID, 1.0).error(np.abs(q @ problem.G.T))
        field, peak = np.abs(q @ self.G.T), problem.amplitude.max(axis=1)
        leaks = [field[:, where].max(axis=1) / peak for where in self.parts]
        line = f"{label:44}{error.mean():8.4f}{error.max():7.3f}{cells.mean():8.4f}"
        line += "".join(f"{one.mean():{7 + i}.2f}{one.max():6.2f}" for i, one in enumerate(leaks))
        print(line + f"{(np.abs(q) ** 2).mean():7.2f}{cost:8.1f}", flush=True)


def solved(problem: Problem, method: Solver, bounded: bool) -> tuple[np.ndarray, np.ndarray | None, float]:
    """Phases, amplitudes if they are bounded, and CPU time in ms."""
    start = time.process_time()
    answer = method.solve(doubled(problem) if bounded else problem)
    cost = 1e3 * (time.process_time() - start)
    theta, level = halves(answer.phase) if bounded else (answer.phase, None)
    return theta, level, cost


def guarded(problem: Problem, guard: Guard) -> Problem:
    G = transfer_matrix(guard.points(GRID), ARRAY, acoustics=Acoustics(medium=AIR, directivity="point"))
    return replace(problem, guard=GuardField(G=G / _focus(), ceiling=guard.ceiling, weight=guard.weight))


def _focus() -> float:
    return float(
        np.abs(transfer_matrix(GRID, ARRAY, acoustics=Acoustics(medium=AIR, directivity="point"))).sum(axis=1).max()
    )


if __name__ == "__main__":
    main()
