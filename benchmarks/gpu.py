"""Batch solvers on a GPU: `make bench-gpu`, or `python -m benchmarks.gpu --backend torch --patterns 64` without one.

Solves all 65535 patterns with `fast`, then one minute of the best mode at 4 kHz with `glide`, and prints wall time,
frames per second and E, including errors and transfers, without the modes of G. NumPy also solves 64 of the patterns.
The exit status is 1 without such a device, or if the errors differ from those of NumPy.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.clock import heading, line
from benchmarks.recordings import pressure_of, problem, wander
from benchmarks.targets import binary, problem_of
from midair.errors import MidairError
from midair.pipeline import resample_pressure
from midair.settings import best_mode
from midair.solvers import Fast, Problem, error_of, one_blas_thread
from midair.solvers.backend import Backend, backend
from midair.solvers.problem import phases_and_errors

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
        return static(options.backend, patterns) | best(options.backend, seconds)


def static(name: str, patterns: int) -> int:
    """Solve independent patterns at strength .1, and compare some of them with NumPy."""
    print(f"\nfast, {patterns} patterns, strength .1")
    heading("wall s", "a second", "E mean", "E worst")
    whole, method = problem_of(binary(list(range(1, patterns + 1))), 0.1), Fast(backend=name)
    few = replace(whole, amplitude=whole.amplitude[:COMPARED])
    # The first call of a device compiles and allocates.
    _, error = _solved(name, method, few)
    difference = abs(float(error.mean()) - float(error_of(few, Fast().solve(few).phase).mean()))
    _told(name, method, whole)
    print(f"mean E of {len(few.amplitude)} of them: {difference:.1e} from NumPy's; {CLOSE:g} is allowed")
    return int(not difference <= CLOSE)


def best(name: str, seconds: float) -> int:
    """Solve a moving spot that vibrates with a chirp, in the best mode at 4 kHz."""
    settings = best_mode()
    asked = problem(resample_pressure(pressure_of(wander(seconds)), settings.target.rate), settings, 0.15)
    print(f"\nglide, best mode, {len(asked.amplitude)} frames, {seconds:g} s of touch, strength .15")
    heading("wall s", "a second", "E mean", "E worst")
    method = replace(settings.solver.method, backend=name)
    return int(not np.isfinite(_told(name, method, asked)).all())


def _told(name: str, method, asked: Problem) -> np.ndarray:
    wall, error = _solved(name, method, asked)
    line(name, wall, len(error) / wall, float(error.mean()), float(error.max()), digits="2044")
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
