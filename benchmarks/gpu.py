"""The batch path on a GPU: `make bench-gpu`, or `python -m benchmarks.gpu --backend torch --patterns 64` without one.

All 65535 patterns with `fast`, then a minute of the best mode at 4 kHz with `glide`: time by the clock, frames a second
and E, with the errors and the way to the host and back; the modes of G are worked out before. 64 of the patterns are
solved by NumPy too. Ends with 1 where there is no such device, or where the errors are not NumPy's.
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
from midair.pipeline import at_rate
from midair.settings import best_mode
from midair.solvers import Fast, Problem, error_of, one_blas_thread
from midair.solvers.backend import Backend, backend
from midair.solvers.device import phases_and_errors

ALL, MINUTE = 65535, 60.0
COMPARED = 64
CLOSE = 2e-3
"""Largest difference of mean E, as the tests allow it in single precision."""


def main() -> int:
    ask = argparse.ArgumentParser(prog="python -m benchmarks.gpu", description=__doc__.splitlines()[0])
    ask.add_argument("--backend", default="torch:cuda", help="torch:cuda (default), cupy, or torch for the CPU")
    ask.add_argument("--patterns", type=int, help="how many of them (default all 65535 on a GPU, else 256)")
    ask.add_argument("--seconds", type=float, help="of the best mode (default 60 on a GPU, else .1)")
    said = ask.parse_args()
    try:
        there = backend(said.backend)
        there.xp.zeros(1, device=there.device)
    # CuPy without a driver has errors of its own, which only CuPy could name.
    except Exception as missing:  # noqa: BLE001
        known = isinstance(missing, MidairError)
        print(f"benchmarks.gpu: no GPU here: {missing if known else repr(missing)}", file=sys.stderr)
        print("benchmarks.gpu: --backend torch --patterns 64 tries the same on the CPU", file=sys.stderr)
        return 1
    patterns = (ALL if there.on_gpu else 256) if said.patterns is None else said.patterns
    seconds = (MINUTE if there.on_gpu else 0.1) if said.seconds is None else said.seconds
    if not 1 <= patterns <= ALL:
        ask.error(f"--patterns: expected 1 to {ALL}, got {patterns}")
    if not 0.1 <= seconds <= 600:
        ask.error(f"--seconds: expected 0.1 to 600, got {seconds:g}")
    print(f"{said.backend}: {_device(there)}")
    with one_blas_thread():
        return static(said.backend, patterns) | best(said.backend, seconds)


def static(name: str, patterns: int) -> int:
    """Patterns on their own, strength .1, and some of them by NumPy."""
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
    """A spot that wanders, its vibration a chirp, in the best mode at 4 kHz."""
    settings = best_mode()
    asked = problem(at_rate(pressure_of(wander(seconds)), settings.target.rate), settings, 0.15)
    print(f"\nglide, best mode, {len(asked.amplitude)} frames, {seconds:g} s of touch, strength .15")
    heading("wall s", "a second", "E mean", "E worst")
    method = replace(settings.solver.method, backend=name)
    return int(not np.isfinite(_told(name, method, asked)).all())


def _told(name: str, method, asked: Problem) -> np.ndarray:
    wall, error = _solved(name, method, asked)
    line(name, wall, len(error) / wall, float(error.mean()), float(error.max()), digits="2044")
    return error


def _solved(name: str, method, asked: Problem) -> tuple[float, np.ndarray]:
    """Seconds by the clock and the error of each frame."""
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
