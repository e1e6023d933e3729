"""Batch solvers on a GPU: `make bench-gpu`, or `python -m benchmarks.gpu --backend torch --patterns 64` without one.

Prints one table: static patterns, smooth and rough sequences in the paper's mode, the best mode at 4 kHz, and all 65535
patterns, each with wall time, frames per second and E, including errors and transfers, without the modes of G. NumPy
also solves 64 of the patterns. The exit status is 1 without such a device, or if the errors differ from those of NumPy.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.clock import heading, line
from benchmarks.recordings import pressure_of, problem, rain, wander
from benchmarks.targets import binary, problem_of
from midair.errors import MidairError
from midair.pipeline import resample_pressure
from midair.settings import Settings, best_mode, paper_mode
from midair.solvers import Fast, Glide, Problem, error_of, one_blas_thread
from midair.solvers.backend import Backend, backend
from midair.solvers.device import phases_and_errors

ALL, MINUTE = 65535, 60.0
COMPARED = 64
CLOSE = 2e-3
"""Largest allowed difference of mean E in single precision, as in the tests."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu", description=__doc__.splitlines()[0])
    parser.add_argument("--backend", default="torch:cuda", help="torch:cuda (default), cupy, or torch for the CPU")
    parser.add_argument("--patterns", type=int, help="number of patterns (default all 65535 on a GPU, else 256)")
    parser.add_argument("--seconds", type=float, help="duration of the best mode in s (default 60 on a GPU, else .1)")
    options = parser.parse_args()
    try:
        there = backend(options.backend)
        there.xp.zeros(1, device=there.device)
    # CuPy without a driver raises its own errors, which cannot be imported without CuPy.
    except Exception as missing:  # noqa: BLE001
        known = isinstance(missing, MidairError)
        print(f"benchmarks.gpu: no GPU here: {missing if known else repr(missing)}", file=sys.stderr)
        print("benchmarks.gpu: use --backend torch --patterns 64 to run on the CPU", file=sys.stderr)
        return 1
    patterns = (ALL if there.on_gpu else 256) if options.patterns is None else options.patterns
    seconds = (MINUTE if there.on_gpu else 0.1) if options.seconds is None else options.seconds
    if not 1 <= patterns <= ALL:
        parser.error(f"--patterns: expected 1 to {ALL}, got {patterns}")
    if not 0.1 <= seconds <= 600:
        parser.error(f"--seconds: expected 0.1 to 600, got {seconds:g}")
    print(f"{options.backend}: {_device(there)}")
    with one_blas_thread():
        return table(options.backend, patterns, seconds)


def table(name: str, patterns: int, seconds: float) -> int:
    """Solve every kind of work and print a row of each; 1 if E differs from NumPy's or is not finite."""
    fast, few = Fast(backend=name), problem_of(binary(list(range(1, COMPARED + 1))), 0.1)
    few = replace(few, amplitude=few.amplitude[:patterns])
    # The first call of a device compiles and allocates.
    _, error = _solved(name, fast, few)
    difference = abs(float(error.mean()) - float(error_of(few, Fast().solve(few).phase).mean()))
    heading("frames", "wall s", "a second", "E mean", "E worst")
    some = problem_of(binary(list(range(1, min(patterns, 4096) + 1))), 0.1)
    errors = [_told(f"static patterns, {name}", name, fast, some)]
    paper, best = paper_mode(), best_mode()
    for label, samples in (("smooth", wander(seconds / 4)), ("rough", rain(seconds / 4))):
        glide = replace(Glide(), backend=name)
        errors.append(_told(f"{label} sequence, paper's mode", name, glide, _asked(samples, paper)))
    errors.append(
        _told("best mode", name, replace(best.solver.method, backend=name), _asked(wander(seconds), best)),
    )
    whole = problem_of(binary(list(range(1, patterns + 1))), 0.1)
    errors.append(_told(f"{patterns} patterns", name, fast, whole))
    print(f"mean E of {len(few.amplitude)} patterns: {difference:.1e} from NumPy's; {CLOSE:g} is allowed")
    return int(not difference <= CLOSE or not all(np.isfinite(each).all() for each in errors))


def _asked(samples: np.ndarray, settings: Settings) -> Problem:
    return problem(resample_pressure(pressure_of(samples), settings.target.rate), settings, 0.15)


def _told(label: str, name: str, method, asked: Problem) -> np.ndarray:
    wall, error = _solved(name, method, asked)
    line(label, len(error), wall, len(error) / wall, float(error.mean()), float(error.max()), digits="02044")
    return error


def _solved(name: str, method, asked: Problem) -> tuple[float, np.ndarray]:
    """Wall time in s and the error of each frame."""
    start = time.perf_counter()
    answer = method.solve(asked)
    if name == "numpy":
        error = error_of(asked, answer.phase)
    else:
        error = phases_and_errors(backend(name, precision="double"), asked, answer.phase, None, None)[1]
    return time.perf_counter() - start, error


def _device(there: Backend) -> str:
    if there.on_gpu and hasattr(there.xp, "cuda") and hasattr(there.xp.cuda, "get_device_name"):
        return there.xp.cuda.get_device_name(there.device)
    return "a GPU" if there.on_gpu else f"the CPU, {platform.machine()}, no GPU in this run"


if __name__ == "__main__":
    sys.exit(main())
