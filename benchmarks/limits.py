"""CPU time of each iteration over the minimum CPU time of its bare matrix products.

`python -m benchmarks.limits` prints what part of the peak of a core the products of the folded solver reach, and what
folding gives for several arrays and grids.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_info

from benchmarks.clock import fastest, heading, line, load, timed
from benchmarks.recordings import folded, sequences
from benchmarks.yardstick import Plain
from midair.datasets import stroke
from midair.model import ControlGrid, TransducerArray
from midair.pipeline import resample_pressure, target_amplitude, with_fitted_gain
from midair.settings import best_mode
from midair.solvers import Exact, LevenbergMarquardt, Live, Problem, one_blas_thread, solve
from midair.solvers.exact import System, state_at
from midair.solvers.field_operators import FieldOperators
from midair.solvers.mirror_symmetry import FoldedProduct
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


class _Counted(np.ndarray):
    """A matrix of which each product is counted in `calls`: FLOP, bytes, and CPU time in s."""

    calls: ClassVar[list[tuple[float, float, float]]] = []

    def __array_ufunc__(self, ufunc, method, *inputs, **other):
        plain = [each.view(np.ndarray) if isinstance(each, _Counted) else each for each in inputs]
        start = time.thread_time()
        made = getattr(ufunc, method)(*plain, **other)
        if ufunc is np.matmul:
            rows, inner, outer = len(plain[0]), *plain[1].shape
            moved = plain[0].nbytes + made.nbytes + plain[1].nbytes
            self.calls.append((8.0 * rows * inner * outer, moved, time.thread_time() - start))
            return made
        return made.view(_Counted)


def roofline(frames: int) -> None:
    """Print what part of this core's peak the products of the folded solver reach, best mode, a towel at 4 kHz."""
    product, operators, kinds = FoldedProduct._each, FieldOperators.of, []

    def counted(self: FoldedProduct, x: np.ndarray, matrices: np.ndarray) -> np.ndarray:
        start = time.thread_time()
        made = product(self, x, matrices)
        # Rows in and out, and the matrices once, which the caches keep for all rows of a batch.
        moved = x.nbytes + made.nbytes + matrices.nbytes
        kinds.append((8.0 * len(x) * matrices.size, moved, time.thread_time() - start))
        return made

    def counting(*given, **how) -> FieldOperators:
        made = operators(*given, **how)
        return replace(made, field=made.field.view(_Counted), field_back=made.field_back.view(_Counted))

    settings, array = best_mode().but(strength=0.15, jobs=1), TransducerArray.autd3()
    pressure = resample_pressure(stroke("towel"), settings.target.rate).cut(0.2, 0.5)
    settings = with_fitted_gain(pressure, array, settings)
    target = target_amplitude(pressure, settings)
    target = replace(target, amplitude=target.amplitude[:frames])

    def work():
        return solve(target, array, settings.solver, acoustics=settings.acoustics)

    with one_blas_thread():
        work()
        whole = min(timed(work)[1] for _ in range(3)) / frames
        FoldedProduct._each, FieldOperators.of = counted, staticmethod(counting)
        try:
            iterations = work().iterations.mean()
        finally:
            FoldedProduct._each, FieldOperators.of = product, operators
        square = np.random.default_rng(0).normal(size=(1024, 1024)).astype(np.complex64)
        peak = 8 * 1024**3 / fastest(lambda: square @ square, 8) / 1e6
        large, copy = np.ones(2**25, np.float32), np.empty(2**25, np.float32)
        memory = 2 * large.nbytes / fastest(lambda: np.copyto(copy, large), 8) / 1e6
    kernel = ", ".join(sorted({each["architecture"] for each in threadpool_info() if "numpy" in each["filepath"]}))
    print(f"\nfolded solver, {frames} frames of the best mode, kernel {kernel}, one core; {load()}")
    print(f"  the core: {peak:.0f} GFLOP/s in complex products of 1024 x 1024, {memory:.1f} GB/s in copies")
    print(f"  a frame: {whole:.2f} ms, {iterations:.1f} iterations")
    for name, calls in (("V, by kinds", kinds), ("the field, whole", _Counted.calls)):
        flops, moved, took = (sum(each[part] for each in calls) for part in range(3))
        each = f"{1e3 * took / frames:.2f} ms, {flops / frames / 1e6:.1f} MFLOP, {moved / frames / 1e6:.2f} MB a frame"
        reached = f"{flops / took / 1e9:.0f} GFLOP/s, {100 * flops / took / 1e9 / peak:.0f} % of the peak"
        print(f"  products with {name}: {each}; {flops / moved:.0f} FLOP a byte; {reached}")


def folding(frames: int) -> None:
    """Print CPU time and E of the best mode, whole and folded, for arrays and grids of several kinds, a towel."""
    plain, rng = TransducerArray.autd3(), np.random.default_rng(0)
    middle = (plain.position.min(axis=0) + plain.position.max(axis=0)) / 2
    spread = (1 + 0.1 * rng.normal(size=plain.count)) * np.exp(0.2j * rng.normal(size=plain.count))
    tilt = Rotation.from_euler("y", 5, degrees=True).as_matrix()
    tilted = replace(plain, position=plain.position @ tilt.T, normal=plain.normal @ tilt.T)
    cases = {
        "as it is": (plain, (0.0, 0.0)),
        "points in the lattice's middle": (plain, (float(middle[0]), float(middle[1]))),
        "points 3 mm beside": (plain, (3e-3, 0.0)),
        "points 10 mm beside": (plain, (10e-3, 0.0)),
        "palm tilted by 5 degrees": (tilted, (0.0, 0.0)),
        "measured": (replace(plain, response=spread), (0.0, 0.0)),
    }
    print(f"\nbest mode, {frames} frames at 4 kHz, of a towel if not named; least CPU of 2 runs, in turns; {load()}")
    pairs = ("ms a frame", "evaluations", "E mean", "E worst")
    columns = ("", *(f"{each}{kind}" for each in pairs for kind in (", whole", ", folded")))
    print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    settings = best_mode().but(strength=0.15, jobs=1)
    towel = resample_pressure(stroke("towel"), settings.target.rate).cut(0.2, 0.5)
    given = [(name, towel, *case) for name, case in cases.items()]
    given += [
        (name, pressure, plain, (0.0, 0.0)) for name, pressure in sequences(settings, frames / settings.target.rate)
    ]
    for name, pressure, array, centre in given:
        fitted = with_fitted_gain(pressure, array, settings.but(grid=ControlGrid(centre=centre)))
        target = target_amplitude(pressure, fitted)
        target = replace(target, amplitude=target.amplitude[:frames])
        took: list[list[float]] = [[], []]
        errors, evaluations = [], ["", ""]
        with one_blas_thread():
            for _ in range(2):
                for folds in (False, True):
                    with folded(folds):
                        made, cost = timed(lambda: solve(target, array, fitted.solver, acoustics=fitted.acoustics))  # noqa: B023
                    took[folds].append(cost / len(made.error))
                    errors.append(made.error)
                    evaluations[folds] = f"{made.iterations[made.plays].mean():.1f}"
        shown = [f"{min(each):.2f}" for each in took] + evaluations + [f"{each.mean():.4f}" for each in errors[:2]]
        print(f"| {name} | " + " | ".join(shown + [f"{each.max():.4f}" for each in errors[:2]]) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.limits", description="Limits of the folded solver.")
    parser.add_argument("--part", choices=("roofline", "folding"), nargs="*", default=["roofline", "folding"])
    parser.add_argument("--frames", type=int, default=900, help="frames of each sequence (default 900)")
    options = parser.parse_args()
    if "roofline" in options.part:
        roofline(options.frames)
    if "folding" in options.part:
        folding(options.frames)


if __name__ == "__main__":
    main()
