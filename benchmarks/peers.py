"""Solvers of the AUTD3 SDK and of AcousTools, if installed, on ten patterns: `python -m benchmarks.peers`.

All get the same targets at the same points of the same array, and one thread. Their phases are judged by midair's
transfer matrix after the best scaling of the field, since none of them fits a level. The SDK rounds phases to 8 bits,
and its time includes sending a pattern to a link without hardware. Every pattern stands alone, so that `glide` has no
neighbours. Times are CPU time of this process. AcousTools needs `pip install acoustools vedo torch`.
"""

# pyright: basic

from __future__ import annotations

import importlib
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks.clock import heading, line, load, timed
from benchmarks.published import best_level
from benchmarks.targets import AIR, ARRAY, GRID, TEN, binary, problem_of
from midair.model import Placement
from midair.solvers import Problem, error_of, one_blas_thread, solver

Rows = tuple[str, Callable[[], np.ndarray]]
"""Label, and function that returns the phases of all patterns, (pattern, transducer), in rad."""

LOUD = 2e4
"""Pressure in Pa that the SDK gets for the strongest focus: of 5 to 50 kPa that at which greedy has the least error."""


def midair(problem: Problem) -> Iterator[Rows]:
    """The solvers of this project for patterns."""
    for method in ("fast", "lm", "glide"):
        yield f"midair {method}", lambda method=method: solver(method, start="zero").solve(problem).phase


def sdk(problem: Problem) -> Iterator[Rows]:
    """The solvers of pyautd3, the SDK of the array."""
    from pyautd3 import AUTD3, Controller, Segment
    from pyautd3.gain import holo
    from pyautd3.link.audit import Audit

    placement = Placement.grid()
    points = (GRID.position * 1e3).astype(np.float32)
    units = [AUTD3(pos=at, rot=turn) for at, turn in zip(placement.origin * 1e3, placement.quaternion, strict=True)]

    def phases(gain: Callable, option: Any) -> np.ndarray:
        found = []
        with Controller.open(units, link := Audit()) as autd:
            autd.environment.sound_speed = AIR.speed * 1e3
            for p in LOUD * problem.amplitude:
                autd.send(
                    gain([(point, float(value) * holo.Pa) for point, value in zip(points, p, strict=True)], option)
                )
                played = [link.drives_at(unit, Segment.S0, 0)[1] for unit in range(placement.units)]
                found.append(2 * np.pi * np.concatenate(played) / 256)
        return np.stack(found)

    yield "pyautd3 GS, 100", lambda: phases(holo.GS, holo.GSOption(repeat=100))
    yield "pyautd3 GSPAT, 100", lambda: phases(holo.GSPAT, holo.GSPATOption(repeat=100))
    yield "pyautd3 greedy, 16 phases", lambda: phases(holo.Greedy, holo.GreedyOption())
    yield "pyautd3 naive", lambda: phases(holo.Naive, holo.NaiveOption())


def acoustools(problem: Problem) -> Iterator[Rows]:
    """The solvers of AcousTools with the transfer matrix of the problem."""
    import torch
    from acoustools.Solvers import gradient_descent_solver, iterative_backpropagation, wgs

    torch.set_num_threads(1)
    torch.manual_seed(0)
    G = torch.tensor(problem.G[None], dtype=torch.complex64)
    points = torch.tensor(GRID.position.T[None], dtype=torch.float32)
    board = torch.tensor(ARRAY.position, dtype=torch.float32)

    def misfit(x: Any, _points: Any, _board: Any, wanted: Any, **_: Any) -> Any:
        return ((torch.abs(G @ x)[:, :, 0] - wanted) ** 2).sum(dim=1)

    def descent(p: Any) -> Any:
        start = torch.exp(2j * torch.pi * torch.rand((1, len(board), 1))).to(torch.complex64)
        how = {"targets": p[None], "start": start, "iters": 200, "lr": 0.1, "log": False}
        return gradient_descent_solver(points, misfit, board, **how)

    def phases(solve: Callable) -> np.ndarray:
        targets = torch.tensor(problem.amplitude, dtype=torch.float32)
        return np.stack([np.angle(solve(p).detach().numpy()).ravel() for p in targets])

    def projected(method: Callable) -> Callable:
        return lambda p: method(points, board=board, A=G, b=p[None, :, None].to(torch.complex64))

    yield "acoustools gradient descent, 200", lambda: phases(descent)
    yield "acoustools iterative backpropagation", lambda: phases(projected(iterative_backpropagation))
    yield "acoustools WGS", lambda: phases(projected(wgs))


def judge(problem: Problem, label: str, solve: Callable[[], np.ndarray]) -> None:
    """Print error and time of a solver, whose field is scaled."""
    theta, cost = timed(solve)
    error = error_of(problem, theta, best_level(problem, theta))
    line(label, error.mean(), error.max(), cost / len(TEN), digits="440")


def main() -> None:
    ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0]).parse_args()
    print(load())
    for strength in (0.1, 0.2):
        problem = problem_of(binary(list(TEN)), strength)
        print(f"\nten patterns, strength {strength}")
        heading("E mean", "E worst", "ms")
        with one_blas_thread():
            for package, solvers in (("midair", midair), ("pyautd3", sdk), ("acoustools", acoustools)):
                try:
                    importlib.import_module(package)
                except ImportError as missing:
                    print(f"{package}: not installed ({missing.name})")
                    continue
                for label, solve in solvers(problem):
                    judge(problem, label, solve)


if __name__ == "__main__":
    main()
