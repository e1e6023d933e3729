"""Solvers of other packages, if installed: the holo solvers of both AUTD3 SDKs, and acoustools.

All packages get the same targets at the same points of the same array. Their phases are rated with this package's G
after the best scaling of the field, because none of them fits a drive level. The SDK rounds phases to 8 bits and models
transducers as its firmware does; its time includes the transfer of a pattern (to a link without hardware).
"""

# Neither package has types.
# pyright: basic

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.targets import AIR, ARRAY, GRID
from midair.model import Placement
from midair.solvers import Problem

Phases = Callable[[], np.ndarray]
"""Function without arguments that returns the phases of all frames, (frame, transducer), in rad."""


def peers(problem: Problem) -> Iterator[tuple[str, Phases]]:
    """Name and function of each solver; packages that are not installed are reported."""
    for package, those in (
        ("autd3_pattern_holo", _autd3),
        ("pyautd3", _pyautd3),
        ("acoustools", _acoustools),
    ):
        if importlib.util.find_spec(package) is None:
            print(f"{package}: not installed")
            continue
        try:
            yield from those(problem)
        except Exception as wrong:  # noqa: BLE001 -- a peer that does not run must not stop the benchmark
            print(f"{package}: does not run here ({type(wrong).__name__}: {str(wrong).splitlines()[0]})")


def _autd3(problem: Problem) -> Iterator[tuple[str, Phases]]:
    import autd3_pattern_holo as holo
    from autd3_core import Length
    from autd3_pattern import IntensityBuffer, PhaseBuffer

    from midair.devices.arrays import autd3_commands

    geometry, units = autd3_commands.geometry(Placement.grid()), Placement.grid().units
    points = (GRID.position * 1e3).astype(np.float32)
    wanted, wavelength = problem.amplitude * 2e4, Length.from_m(AIR.speed / ARRAY.frequency)

    def solve(run: Callable) -> np.ndarray:
        found = []
        for p in wanted:
            phases, intensities = PhaseBuffer(units), IntensityBuffer(units)
            foci = [holo.AmplitudeTarget(point, float(value) * holo.Pa) for point, value in zip(points, p, strict=True)]
            run(foci, phases, intensities)
            found.append(2 * np.pi * phases.to_numpy().ravel() / 256)
        return np.stack(found)

    full = holo.IntensityConstraint.Uniform(255)
    for label, method, option in (
        ("GS, 100", holo.gs, holo.GsOption(repeat=100, constraint=full)),
        ("GSPAT, 100", holo.gspat, holo.GspatOption(repeat=100, constraint=full)),
        ("Naive", holo.naive, holo.NaiveOption(constraint=full)),
    ):
        yield (
            f"autd3 {label}",
            lambda method=method, option=option: solve(
                lambda foci, phases, intensities: method(geometry, foci, wavelength, option, phases, intensities)
            ),
        )
    yield (
        "autd3 Greedy, 16 phases",
        lambda: solve(
            lambda foci, phases, _: holo.greedy(
                geometry, foci, wavelength, 255, holo.GreedyOption(phase_quantization_levels=16), phases
            )
        ),
    )


def _pyautd3(problem: Problem) -> Iterator[tuple[str, Phases]]:
    from pyautd3 import AUTD3, Controller, Segment
    from pyautd3.gain import holo
    from pyautd3.link.audit import Audit

    placement = Placement.grid()
    units = [AUTD3(pos=at, rot=turn) for at, turn in zip(placement.origin * 1e3, placement.quaternion, strict=True)]
    points = (GRID.position * 1e3).astype(np.float32)
    # In Pa of the SDK's own transducer model. Greedy is the only one that minds: of 5, 10, 15, 20, 25 and 50 kPa for a
    # focus of the whole array this is where its error is least.
    wanted = problem.amplitude * 2e4

    def solve(make: Callable) -> np.ndarray:
        with Controller.open(units, link := Audit()) as autd:
            autd.environment.sound_speed = AIR.speed * 1e3
            turned = []
            for p in wanted:
                autd.send(make([(point, float(value) * holo.Pa) for point, value in zip(points, p, strict=True)]))
                drives = [link.drives_at(unit, Segment.S0, 0)[1] for unit in range(placement.units)]
                turned.append(2 * np.pi * np.concatenate(drives) / 256)
        return np.stack(turned)

    for label, gain, option in (
        ("GS, 100", holo.GS, holo.GSOption(repeat=100)),
        ("GSPAT, 100", holo.GSPAT, holo.GSPATOption(repeat=100)),
        ("Naive", holo.Naive, holo.NaiveOption()),
        ("Greedy, 16 phases", holo.Greedy, holo.GreedyOption()),
    ):
        yield f"pyautd3 {label}", lambda gain=gain, option=option: solve(lambda foci: gain(foci, option))


def _acoustools(problem: Problem) -> Iterator[tuple[str, Phases]]:
    import torch
    from acoustools.Solvers import gradient_descent_solver, iterative_backpropagation, wgs

    torch.set_num_threads(1)
    torch.manual_seed(0)
    G = torch.tensor(problem.G[None], dtype=torch.complex64)
    targets = torch.tensor(problem.amplitude, dtype=torch.float32)
    points = torch.tensor(GRID.position.T[None], dtype=torch.float32)
    board = torch.tensor(ARRAY.position, dtype=torch.float32)

    def misfit(x, _points, _board, wanted, **_):
        return ((torch.abs(G @ x)[:, :, 0] - wanted) ** 2).sum(dim=1)

    def each(solve: Callable) -> np.ndarray:
        return np.stack([np.angle(solve(p).detach().numpy()).ravel() for p in targets])

    def descent(p):
        start = torch.exp(2j * torch.pi * torch.rand((1, len(board), 1))).to(torch.complex64)
        return gradient_descent_solver(
            points, misfit, board=board, targets=p[None], start=start, iters=200, lr=0.1, log=False
        )

    def batch(p):
        return p[None, :, None].to(torch.complex64)

    yield "acoustools wgs, 200", lambda: each(lambda p: wgs(points, board=board, A=G, b=batch(p)))
    yield (
        "acoustools iterative backprop., 200",
        lambda: each(lambda p: iterative_backpropagation(points, board=board, A=G, b=batch(p))),
    )
    yield "acoustools gradient descent, 200", lambda: each(descent)
