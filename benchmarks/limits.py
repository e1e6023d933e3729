"""CPU time of each iteration over the minimum CPU time of its bare matrix products."""

from __future__ import annotations

import numpy as np

from benchmarks.clock import fastest, heading, line
from benchmarks.yardstick import Plain
from midair.solvers import Exact, LevenbergMarquardt, Live, Problem
from midair.solvers.exact import System, state_at
from midair.solvers.modes import modes


def limits(problem: Problem, name: str, reference: Plain) -> None:
    """Print the ratios for `problem`, which has one frame."""
    print("\none iteration, and its matrix products, factor and solve alone; least CPU time of many runs")
    heading("ms", "bare ms", "ratio")
    p, x = problem.amplitude[0], np.random.default_rng(0).uniform(-np.pi, np.pi, problem.transducers + problem.points)
    rows = (
        (name, lambda: reference(problem.G, p, 1, x), _dual(problem, len(x), 1)),
        ("lm", _one_plain(problem, p, x), _dual(problem, problem.transducers, 2)),
        ("exact", *_exact(problem, p, x)),
    )
    for label, whole, bare in rows:
        took, least = fastest(whole, 20), fastest(bare, 20)
        line(label, took, least, took / least, digits="331")
    for label, whole, least in _live(problem):
        line(label, whole, least, whole / least, digits="331")


def _dual(problem: Problem, width: int, products: int):
    """J J^T of the dual form, as one product of 2M rows or two of M rows, and the factorisation of 2M rows."""
    from scipy.linalg import cho_factor

    rng, rows = np.random.default_rng(0), 2 * problem.points // products
    J, K = rng.normal(size=(rows, width)), np.eye(2 * problem.points)

    def work():
        for _ in range(products):
            J @ J.T
        cho_factor(K, check_finite=False)

    return work


def _one_plain(problem: Problem, p: np.ndarray, x: np.ndarray):
    method = LevenbergMarquardt()
    state = method.begin(problem, p, x)
    return lambda: method.step(problem, p, state)


def _exact(problem: Problem, p: np.ndarray, x: np.ndarray):
    from scipy.linalg.blas import ssymm, ssyrk
    from scipy.linalg.lapack import sgesv

    settings = Exact()
    system = System.of(modes(problem.G, tolerance=settings.tolerance), problem.level, "single")
    state = state_at(system, p, x, 1e-5)
    R, rows = system.real, np.ones((int((p > 0).sum()), 2 * len(system.power)), np.float32)
    K, b = np.asfortranarray(system.normal(x)), np.ones(2 * len(system.power), np.float32)
    damped = np.asfortranarray(K + np.eye(len(b), dtype=np.float32))

    def bare():
        ssyrk(1, R.T, trans=1)
        ssyrk(1, R.T, trans=1)
        ssymm(-1, ssyrk(1, rows.T), K)
        sgesv(damped, b)

    return lambda: settings.step(system, p, state), bare


def _live(problem: Problem):
    """Both steps of a frame without the fixed cost of the frame, which is measured with 0 iterations."""
    p, tens = problem.amplitude[0], {}
    for field, lift in ((0, 0), (40, 0), (0, 40)):
        follower = Live(warm_iterations=field, warm_lift_iterations=lift).begin(problem)
        follower.follow(p)
        tens[field, lift] = fastest(lambda follower=follower: follower.follow(p))
    rank, some = modes(problem.G, tolerance=Live().tolerance).rank, -(-problem.transducers // Live().every)
    rng = np.random.default_rng(0)

    def pair(wide: int):
        A = (rng.normal(size=(rank, wide)) + 1j * rng.normal(size=(rank, wide))).astype(np.complex64)
        a, b = np.ones(rank, np.complex64), np.ones(wide, np.complex64)
        return lambda: (A.T @ a, A @ b)

    to_points, to_some, to_all = (fastest(pair(wide)) for wide in (problem.points, some, problem.transducers))
    yield "live, field", (tens[40, 0] - tens[0, 0]) / 40, to_points + to_some
    yield "live, lift", (tens[0, 40] - tens[0, 0]) / 40, to_all
    yield "live, a frame at no iteration", tens[0, 0], to_points
