"""`python -m tests.kernels`: run the numerical tests under each OpenBLAS kernel that this processor can run.

A kernel decides the last bits of a matrix product. A test that passes with one kernel only is a test of a machine.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

NEEDS = {"Haswell": {"avx2", "fma"}, "Zen": {"avx2", "fma"}, "SkylakeX": {"avx512f"}, "Sandybridge": {"avx"}}
"""Instructions that each kernel needs, by the names in /proc/cpuinfo."""

NUMERICAL = [
    "tests/calibration",
    "tests/correct",
    "tests/evaluate",
    "tests/paper",
    "tests/physics",
    "tests/solvers",
    "tests/study/statistics",
    "tests/sweep",
    "tests/targets",
    "tests/test_blas.py",
    "tests/test_pipeline.py",
]

NAME = "import numpy; from threadpoolctl import threadpool_info as info; print(info()[0].get('architecture'))"


def instructions() -> set[str]:
    listed = Path("/proc/cpuinfo")
    if platform.machine() not in {"x86_64", "AMD64"} or not listed.exists():
        return set()
    return next((set(line.split()) for line in listed.read_text().splitlines() if line.startswith("flags")), set())


def chosen(env: dict[str, str]) -> str:
    """The kernel that NumPy's OpenBLAS takes in an environment."""
    return subprocess.run(
        [sys.executable, "-c", NAME], env=env, capture_output=True, text=True, check=True
    ).stdout.strip()


def main(kernels: list[str]) -> int:
    there, failed, own = instructions(), [], chosen(dict(os.environ))
    for kernel in kernels or NEEDS:
        if missing := NEEDS[kernel] - there:
            print(f"{kernel}: left out, this processor does not list {' and '.join(sorted(missing))}", flush=True)
            continue
        env = os.environ | {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
        taken = chosen(env)
        if taken.lower() != kernel.lower():
            print(f"{kernel}: left out, NumPy's OpenBLAS runs {taken} for it", flush=True)
            continue
        if not kernels and taken == own:
            print(f"{kernel}: left out, `make test` runs with it on this processor", flush=True)
            continue
        print(f"{kernel}:", flush=True)
        words = [sys.executable, "-m", "pytest", "-q", "--numprocesses", "2", "--dist", "worksteal", *NUMERICAL]
        failed += [kernel] if subprocess.run(words, env=env, check=False).returncode else []
    print(f"failed under {', '.join(failed)}" if failed else "passed under each kernel that was run")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
